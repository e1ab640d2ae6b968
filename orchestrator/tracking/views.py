"""A run directory as MLflow should show it: one parent run, one child a (method, seed)."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.schema import DATASETS, EPISODES, PROVENANCE, SPEC, TRAINING, RunSpec, leaves
from orchestrator.tracking.changes import short_changes
from orchestrator.tracking.metrics import (
    Curves,
    finite,
    learning_curves,
    mean_score,
    reported,
    seed_scores,
)
from orchestrator.tracking.names import allowed_name, run_name, short_id, short_text
from orchestrator.tracking.receipt import Status, digest, published_files, read_json

if TYPE_CHECKING:
    import pandas as pd

RUN_ID, METHOD, SEED = IDENTITY = ("skillstitch.run_id", "skillstitch.method", "skillstitch.seed")
SPENT = ("seconds", "busy worker seconds", "counts")  # parts of the provenance that are numbers
NOTE = "mlflow.note.content"  # the description that MLflow shows at the top of a run


@dataclass(frozen=True)
class RunView:
    """One MLflow run as it should be."""

    name: str
    status: Status
    identity: tuple[str, str, str]  # values of IDENTITY; no method and seed for the parent
    tags: dict[str, str]
    params: dict[str, str]
    numbers: dict[str, float]  # metrics without a history: scores, intervals, timings
    curves: Curves
    datasets: list[dict[str, Any]] = field(default_factory=list)
    files: dict[str, Path] = field(default_factory=dict)  # artifacts

    @property
    def content(self) -> str:
        """Digest of all that is logged; the status is kept apart."""
        plain = asdict(replace(self, status="RUNNING", files={}))
        return hashlib.sha256(f"{json.dumps(plain)}{digest(self.files)}".encode()).hexdigest()


def read_views(
    run_dir: Path, status: Status, training: list[dict[str, Any]] | None = None
) -> list[RunView]:
    """The parent's view, then one for each (method, seed) that there is something to show of.

    training: in place of `training.json`.
    """
    plain = json.loads((run_dir / SPEC).read_text(encoding="utf-8"))
    provenance = json.loads((run_dir / PROVENANCE).read_text(encoding="utf-8"))
    training = read_json(run_dir / TRAINING, []) if training is None else training
    spec = RunSpec.from_dict(plain)
    parent = RunView(
        name=run_name(
            spec.name,
            spec.scale,
            short_changes(spec.origin.changed if spec.origin else ()),
            short_id(provenance["run_id"]),
        ),
        status=status,
        identity=(provenance["run_id"], "", ""),
        tags=_tags(spec, provenance) | {NOTE: spec.title, "skillstitch.run_dir": str(run_dir)},
        params={
            allowed_name(name): short_text(value)
            for name, value in leaves(plain["spec"], ".").items()
        },
        numbers=finite(
            *(leaves({part: provenance.get(part, {})}, "/") for part in SPENT),
            *(reported(run_dir / "report", entry.id) for entry in spec.tables),
        ),
        curves={},
        datasets=read_json(run_dir / DATASETS, []),
        files={
            name: path
            for name, path in published_files(run_dir).items()
            if name in (SPEC, PROVENANCE) or name.startswith("report/")
        },
    )
    episodes = _read_episodes(run_dir)
    played = dict(list(episodes.groupby(["method", "seed"])))
    children = [
        _child(parent, spec, method, seed, training, played.get((method, seed), episodes.iloc[:0]))
        for method in spec.methods
        for seed in spec.seeds
    ]
    return [parent, *(child for child in children if child.numbers or child.curves)]


def _child(
    parent: RunView,
    spec: RunSpec,
    method: str,
    seed: int,
    training: list[dict[str, Any]],
    episodes: pd.DataFrame,
) -> RunView:
    """One method under one seed, its metrics named as all others' so that they can be compared."""
    alone = replace(spec, methods={method: spec.methods[method]}, seeds=(seed,))
    numbers = finite(
        mean_score(episodes), *(seed_scores(episodes, alone, entry) for entry in spec.tables)
    )
    return RunView(
        name=run_name(method, f"seed {seed}", short_id(parent.identity[0])),
        status="FINISHED" if numbers else parent.status,
        identity=(parent.identity[0], method, str(seed)),
        tags={name: value for name, value in parent.tags.items() if name != NOTE},
        params=parent.params | _overrides(method) | {"method": method, "seed": str(seed)},
        numbers=numbers,
        curves=learning_curves(method, spec.models.get(method), seed, training),
        datasets=parent.datasets,
    )


def _tags(spec: RunSpec, provenance: Mapping[str, Any]) -> dict[str, str]:
    tags = {
        "mlflow.source.name": "skillstitch",
        "mlflow.source.git.commit": provenance.get("git_revision"),
        "skillstitch.spec": spec.name,
        "skillstitch.benchmark": spec.benchmark,
        "skillstitch.scale": spec.scale,
        "skillstitch.cpu": provenance.get("cpu"),
        **leaves({"version": provenance.get("versions", {})}, "."),
    }
    return {name: short_text(value) for name, value in tags.items() if value}


def _overrides(method: str) -> dict[str, str]:
    """ "mb-stitch[alpha=1]" was played with another `mb_stitch.alpha` than the spec's."""
    name = method.partition("[")[0].replace("-", "_")
    return {f"{name}.{key}": value for key, value in re.findall(r"([\w.]+)=([^,\]]+)", method)}


def _read_episodes(run_dir: Path) -> pd.DataFrame:
    import pandas as pd

    from analysis.episodes import COLUMNS

    path = run_dir / EPISODES
    return pd.read_parquet(path) if path.is_file() else pd.DataFrame(columns=COLUMNS)
