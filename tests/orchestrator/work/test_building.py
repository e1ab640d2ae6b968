"""Artifacts: tried again, rebuilt when damaged, refused when unusable or changed."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator import reproduction as reproducing
from orchestrator.errors import BadDataError, ChangedError, IncompleteError
from orchestrator.executors.serial import SerialExecutor
from orchestrator.spec.spec import Spec
from orchestrator.storage.store import Artifact
from orchestrator.work.building import Builds
from orchestrator.work.checkpoints import CheckpointFile
from orchestrator.work.jobs import ATTEMPTS, BuildJob, Job, Report
from orchestrator.work.plan import Plan
from orchestrator.work.progress import Silent
from stitching.models import training
from tests.orchestrator.tiny import Counted, Lines, Place, promised_bytes


class ForgetfulBuilder(SerialExecutor):
    """Loses its worker during the first builds of an artifact."""

    def __init__(self, losses: int) -> None:
        super().__init__()
        self.losses: Counter[str] = Counter()
        self.most = losses

    def next(self) -> Report:
        job = self._jobs[0]
        if isinstance(job, BuildJob) and job.recipe.kind == "agent":
            self.losses[job.recipe.key] += 1
            if self.losses[job.recipe.key] <= self.most:
                self._jobs.popleft()
                return Report(job, trouble="lost", error="the worker died")
        return super().next()


def test_a_worker_lost_while_training(
    plan: Plan, place: Place, finished: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    place.out.mkdir()
    ledger, lines = place.directory.ledger(), Lines()
    Builds(plan, place.store, ledger, ForgetfulBuilder(2), lines).run(plan.needed, set())
    for key in plan.needed:
        kind = plan.recipes[key].kind
        assert place.store.read(kind, key).digest == finished.store.read(kind, key).digest
    assert "building agent again: the worker died" in lines.text


class Checkpointed(SerialExecutor):
    """Remembers where trainings were told to leave checkpoints."""

    def __init__(self) -> None:
        super().__init__()
        self.places: dict[str, Path | None] = {}

    def submit(self, job: Job) -> None:
        if isinstance(job, BuildJob):
            self.places[job.recipe.key] = job.checkpoints
        super().submit(job)


def test_trainings_leave_checkpoints_in_the_store_while_they_last(
    plan: Plan, place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every one its own, and none remains when the artifact is there."""
    monkeypatch.setattr(training, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    monkeypatch.setattr(training, "DRAWN_AT_ONCE", 1)
    kept: list[Path] = []
    write = CheckpointFile.write

    def written(checkpoint: CheckpointFile, tensors: Any, plain: Any) -> None:
        write(checkpoint, tensors, plain)
        assert checkpoint.path.is_file()
        kept.append(checkpoint.path)

    monkeypatch.setattr(CheckpointFile, "write", written)
    place.out.mkdir()
    executor = Checkpointed()
    Builds(plan, place.store, place.directory.ledger(), executor, Silent()).run(plan.needed, set())
    around = place.store.root.resolve() / "checkpoints"
    assert executor.places == {key: around / key for key in plan.needed}
    trained = {key for key in plan.needed if plan.recipes[key].kind in ("agent", "dynamics")}
    assert trained <= {path.parent.name for path in kept}
    assert list(around.iterdir()) == []


def test_an_artifact_that_cannot_be_built(spec: Spec, plan: Plan, place: Place) -> None:
    place.out.mkdir()
    builds = Builds(
        plan, place.store, place.directory.ledger(), ForgetfulBuilder(ATTEMPTS), Silent()
    )
    with pytest.raises(IncompleteError, match=r"building agent \w+ failed 3 times.*\n.*died"):
        builds.run(plan.needed, set())


def test_a_damaged_artifact_is_named_set_aside_and_rebuilt(
    spec: Spec, plan: Plan, done: Place, expected: dict[str, bytes], counted: Counted
) -> None:
    key = plan.by_seed("agent")[1]
    file = done.store.path("agent", key) / "arrays.safetensors"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    before = done.store.manifest("agent", key)["digest"]
    lines = Lines()
    done.carry_out(spec, lines)
    assert f"damaged artifact, will be rebuilt: {file}: content does not match" in lines.text
    (aside,) = (done.store_root / "corrupt").iterdir()
    assert (aside / "arrays.safetensors").read_bytes() == bytes(content)
    assert str(aside) in lines.text
    assert counted.built == {key: 1}
    assert not counted.played
    assert done.store.read("agent", key).digest == before
    assert promised_bytes(done.out) == expected
    assert done.directory.finished


def test_an_artifact_with_other_bytes_than_the_blocks_were_played_with(
    spec: Spec, plan: Plan, done: Place
) -> None:
    """Whole, under the right name, but not what this run's ledger saw."""
    key = plan.by_seed("agent")[0]
    real = done.store.read("agent", key)
    arrays = {name: array + array.dtype.type(1) for name, array in real.arrays.items()}
    done.store.write("agent", key, Artifact(arrays, real.info), {"kind": "agent"})
    with pytest.raises(ChangedError, match=rf"agent {key} now has other bytes .* --out") as caught:
        done.carry_out(spec)
    assert caught.value.exit_code == 5


def test_a_rebuilt_artifact_with_other_bytes(
    spec: Spec, plan: Plan, done: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on another kind of machine: the blocks so far do not belong to it."""
    key = plan.by_seed("dynamics")[0]
    done.store.discard("dynamics", key)

    class Other(SerialExecutor):
        def next(self) -> Report:
            report = super().next()
            assert report.artifact is not None
            arrays = {n: a + a.dtype.type(1) for n, a in report.artifact.arrays.items()}
            return replace(report, artifact=Artifact(arrays, report.artifact.info))

    monkeypatch.setattr(reproducing, "open_executor", lambda *_: Other())
    with pytest.raises(ChangedError, match=f"dynamics {key}"):
        done.carry_out(spec)


def nan(column: np.ndarray) -> np.ndarray:
    column = column.copy()
    column[17, 2] = np.nan
    return column


@pytest.mark.parametrize(
    ("column", "spoil", "complaint"),
    [
        ("observations", nan, "observations.npy: row 17 is not finite"),
        ("observations", lambda c: c[:, :5], r"observations.npy: shape \(\d+, 5\), expected"),
        ("actions", lambda c: 3 * c, "actions.npy: row 0 has an action outside"),
        ("next_observations", lambda c: c[:-1], "next_observations.npy: shape"),
        ("episode_ends", lambda c: c[::-1], "episode_ends.npy: row 1"),
        ("episode_skills", lambda c: c + 4, "episode_skills.npy: row 0 names skill 4"),
    ],
)
def test_unusable_data_is_refused_before_training(
    spec: Spec,
    plan: Plan,
    place: Place,
    finished: Place,
    monkeypatch: pytest.MonkeyPatch,
    column: str,
    spoil: Callable[[np.ndarray], np.ndarray],
    complaint: str,
) -> None:
    key = plan.datasets["demonstrations"]
    real = finished.store.read("maze-demonstrations", key)
    arrays = real.arrays | {column: np.ascontiguousarray(spoil(real.arrays[column]))}
    place.store.write("maze-demonstrations", key, Artifact(arrays, real.info), {"kind": "x"})

    def untouched(*_: object) -> None:
        raise AssertionError("something was trained on it")

    for name in ("train_iql", "train_dynamics"):
        monkeypatch.setattr(f"orchestrator.builders.training.{name}", untouched)
    folder = place.store.path("maze-demonstrations", key)
    with pytest.raises(BadDataError, match=rf"{folder}/{complaint}") as caught:
        place.carry_out(spec)
    assert caught.value.exit_code == 7


def test_training_that_diverges(spec: Spec, plan: Plan, place: Place, finished: Place) -> None:
    """Data that are finite, and too large to be squared."""
    key = plan.datasets["demonstrations"]
    real = finished.store.read("maze-demonstrations", key)
    arrays = real.arrays | {"next_observations": real.arrays["next_observations"] + 1e37}
    arrays["next_observations"] = arrays["next_observations"].astype(np.float32)
    place.store.write("maze-demonstrations", key, Artifact(arrays, real.info), {"kind": "x"})
    with pytest.raises(BadDataError, match=r"\w+ \w+: training diverged: \w+ is (nan|inf)"):
        place.carry_out(spec)
