"""`skillstitch export`: a run's models and data as files, for use without its store."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save_file

from analysis.files import replaced_folder
from analysis.schema import PROVENANCE
from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.errors import UsageError
from orchestrator.spec.structure import Plain
from orchestrator.storage.claim import spec_of
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Artifact, Store, make_folder, storage_errors
from orchestrator.work.plan import Plan, make_plan
from stitching.data.transitions import NO_SKILL, Transitions
from stitching.envs.protocol import Benchmark

CARD = """# {title}

Models and data of `{name}` at {scale} scale, exported by skillstitch {revision}.

- `models/*.safetensors` are weights, each with a JSON card of the same name. Policies and values
  are read by `stitching.models.agent.Agent`, dynamics by `stitching.models.dynamics.Dynamics`:
  see `docs/examples/exported_models.py` of skillstitch.
- `datasets/` has a Minari dataset for each dataset that was learned from. With
  MINARI_DATASETS_PATH set to it, `minari.load_dataset("{dataset}")` reads one. An episode's
  options name its skill and whether it was accomplished.

Skills, by their numbers: {skills}.
"""


def export_run(directory: RunDirectory, out: Path, store_root: Path | None) -> Iterator[str]:
    """Write every model and dataset of a run to a new folder; says what is in it.

    Raises UsageError where there is no single run, where the store lacks something of it, where the
    folder exists, and where Minari is not installed.
    """
    _check_minari()
    if out.exists():
        raise UsageError(f"{out} exists; name a new folder")
    plan, store = make_plan(spec_of(directory)), Store(store_root or directory.store_root)
    models, datasets = _names_of_models(plan), plan.datasets
    content = {
        name: store.demand(plan.recipes[key].kind, key) for name, key in (models | datasets).items()
    }
    provenance = directory.read_json(PROVENANCE) or {}
    make_folder(out.parent)
    with storage_errors(out.parent), replaced_folder(out) as draft:
        for folder in ("models", "datasets"):
            (draft / folder).mkdir()
        for name, key in models.items():
            card = _card(plan, key, content[name])
            _write_model(draft / "models" / name, content[name], card)
        with _minari_writes_to(draft / "datasets"):
            for role in datasets:
                _write_dataset(plan, role, content[role])
        text = _describe(plan, str(provenance.get("git_revision", "of an unknown revision")))
        (draft / "README.md").write_text(text, encoding="utf-8")
    yield f"exported {len(models)} models and {len(datasets)} datasets to {out}"


def dataset_id(plan: Plan, role: str) -> str:
    """The Minari id of one of the plan's datasets."""
    return f"skillstitch/{plan.spec.benchmark}-{role}-v0"


def _check_minari() -> None:
    try:
        import minari  # noqa: F401
    except ModuleNotFoundError as error:
        raise UsageError(
            f"{error.name} is not installed, which writes datasets: install skillstitch with its "
            "extra `human`, as in `pip install -e '.[human]'`"
        ) from None


def _names_of_models(plan: Plan) -> dict[str, str]:
    """File name → key; a model of one method is named by it."""
    names: dict[str, str] = {}
    for (kind, seed, method), key in plan.models.items():
        alike = {k for (one, s, _), k in plan.models.items() if (one, s) == (kind, seed)}
        own = f"-{method}" if len(alike) > 1 else ""
        if key not in names.values():
            names[f"{kind}-seed-{seed}{own}"] = key
    return names


def _card(plan: Plan, key: str, model: Artifact) -> Plain:
    recipe, benchmark = plan.recipes[key], BENCHMARKS[plan.spec.benchmark]
    return {
        "kind": recipe.kind,
        "benchmark": benchmark.name,
        "skills": {skill.name: list(skill.condition) for skill in benchmark.skills},
        "actions": {"size": benchmark.actions.size, "discrete": benchmark.actions.discrete},
        "config": recipe.params.get("config", {}),
        "seed": recipe.params.get("seed"),
        "key": key,
        "digest": model.digest,
    }


def _write_model(path: Path, model: Artifact, card: Plain) -> None:
    arrays = {name: np.asarray(array, order="C") for name, array in model.arrays.items()}
    save_file(arrays, path.with_name(f"{path.name}.safetensors"))
    text = json.dumps(card, indent=1, sort_keys=True) + "\n"
    path.with_name(f"{path.name}.json").write_text(text, encoding="utf-8")


def _write_dataset(plan: Plan, role: str, dataset: Artifact) -> None:
    import minari
    from gymnasium.spaces import Box

    benchmark = BENCHMARKS[plan.spec.benchmark]
    columns = {name: dataset.arrays[name] for name in Transitions.__dataclass_fields__}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no author, and no environment to make
        minari.create_dataset_from_buffers(
            dataset_id(plan, role),
            list(_episodes(Transitions(**columns), benchmark)),
            observation_space=Box(-np.inf, np.inf, (benchmark.observation_size,), np.float32),
            action_space=Box(-1, 1, (benchmark.actions.size,), np.float32),
            description=f"{role} of {benchmark.name}, as skillstitch learned from them",
        )


def _episodes(data: Transitions, benchmark: Benchmark) -> Iterator[Any]:
    """As Minari has them: stretches in which each state follows from the one before."""
    from minari.data_collector import EpisodeBuffer

    for episode, (start, end) in enumerate(
        zip(data.episode_starts, data.episode_ends, strict=True)
    ):
        skill = int(data.episode_skills[episode])
        success = bool(data.episode_successes[episode])
        after, before = data.next_observations[start : end - 1], data.observations[start + 1 : end]
        breaks = start + 1 + np.flatnonzero((after != before).any(axis=1))
        for first, last in zip([start, *breaks], [*breaks, end], strict=True):
            length = int(last - first)
            ends_well = np.zeros(length, dtype=bool)
            ends_well[-1] = success and last == end
            yield EpisodeBuffer(
                observations=np.vstack(
                    [data.observations[first:last], data.next_observations[last - 1 : last]]
                ),
                actions=data.actions[first:last],
                rewards=ends_well.astype(float).tolist(),
                terminations=ends_well.tolist(),
                truncations=[False] * (length - 1) + [not ends_well[-1]],
                options={
                    "skill": "" if skill == NO_SKILL else benchmark.skills[skill].name,
                    "accomplished": bool(ends_well[-1]),
                },
            )


@contextmanager
def _minari_writes_to(folder: Path) -> Iterator[None]:
    name = "MINARI_DATASETS_PATH"
    before = os.environ.get(name)
    os.environ[name] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


def _describe(plan: Plan, revision: str) -> str:
    spec = plan.spec
    return CARD.format(
        title=spec.title,
        name=spec.name,
        scale=spec.scale,
        revision=revision,
        dataset=dataset_id(plan, next(iter(plan.datasets))) if plan.datasets else "",
        skills=", ".join(f"{number} {name}" for number, name in enumerate(spec.skill_names)),
    )
