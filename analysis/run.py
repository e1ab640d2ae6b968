"""A finished (or half-finished) run directory, read into memory."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.schema import (
    DATASETS,
    DIAGNOSIS,
    PROVENANCE,
    QUARANTINE,
    SEGMENTS,
    SHOWCASE,
    SPEC,
    STITCHES,
    TRAINING,
    RunError,
    RunSpec,
)

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Run:
    """Everything a report needs. Optional files that are absent read as empty."""

    spec: RunSpec
    segments: pd.DataFrame
    provenance: dict[str, Any]
    quarantine: list[dict[str, Any]]
    training: list[dict[str, Any]]
    showcases: dict[str, Any]  # by part, as `stitches`
    datasets: list[dict[str, Any]]
    diagnoses: dict[str, Any]  # by part, as `stitches`
    stitches: dict[str, Any]  # by part, of a merged run; else by "" alone

    @property
    def diagnosis(self) -> dict[str, Any]:
        """Of a run that was not merged: what its report says of its models; {} if unknown."""
        return self.diagnoses.get("", {})


def load_run_spec(run_dir: Path) -> RunSpec:
    """What was asked of a run, without what it played."""
    return RunSpec.from_dict(_read_json(run_dir / SPEC, {}))


def load_run(run_dir: Path) -> Run:
    """Reads a run directory, or says what it lacks."""
    import pandas as pd  # the words above are used where pandas need not be paid for

    segments = run_dir / SEGMENTS
    for needed in (run_dir / SPEC, segments):
        if not needed.is_file():
            raise RunError(
                f"no {needed.name} in {run_dir}: give the directory of a run that has finished "
                "at least one block"
            )
    return Run(
        spec=load_run_spec(run_dir),
        segments=pd.read_parquet(segments),
        provenance=_read_json(run_dir / PROVENANCE, {}),
        quarantine=_read_json(run_dir / QUARANTINE, []),
        training=_read_json(run_dir / TRAINING, []),
        showcases=_by_part(_read_json(run_dir / SHOWCASE, {})),
        datasets=_read_json(run_dir / DATASETS, []),
        diagnoses=_by_part(_read_json(run_dir / DIAGNOSIS, {})),
        stitches=_by_part(_read_json(run_dir / STITCHES, {})),
    )


def _by_part(study: dict[str, Any]) -> dict[str, Any]:
    """A study of each part, by its label: merged runs keep them so, others have but one."""
    parts: dict[str, Any] = study.get("parts", {"": study} if study else {})
    return parts


def _read_json(path: Path, default: Any) -> Any:
    if not path.is_file():
        return default
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise RunError(f"{path} is not valid JSON ({error}): run the same command again") from None
