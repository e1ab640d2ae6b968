"""A training that was killed goes on from its last checkpoint and ends with the same bytes."""

import hashlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save
from torch import Tensor

from orchestrator.work.checkpoints import NEWS, CheckpointFile, Checkpoints
from stitching.envs.maze import MAZE
from stitching.envs.protocol import ActionSpace
from stitching.models import training
from stitching.models.checkpoints import checkpoint_of, checkpoints_by
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql, train_single_tasks
from stitching.models.layers import parameters
from stitching.models.training import DRAWN_AT_ONCE, CurveLog, Trained
from tests.stitching.models.test_iql import experience_of

UPDATES = 3 * DRAWN_AT_ONCE + 7
IQL = IQLConfig(updates=UPDATES, batch_size=8, width=4, members=2, log_every=100)
DYNAMICS = DynamicsConfig(updates=UPDATES, batch_size=8, width=4, members=2, log_every=100)


def agent() -> Trained:
    return train_iql(experience_of(MAZE.actions), MAZE.actions, IQL, "checkpoints")


def single_tasks() -> Trained:
    return train_single_tasks(experience_of(MAZE.actions), MAZE.actions, IQL, "checkpoints")


def gaussian() -> Trained:
    """Continuous actions, half precision, and a policy that goes on from another."""
    arm = ActionSpace(3, discrete=False)
    config = replace(IQL, precision="bfloat16", learning_rate_decay=False)
    start = train_iql(experience_of(arm), arm, replace(config, updates=0), "start").weights
    policy = parameters(start, "policy")
    return train_iql(experience_of(arm), arm, config, "checkpoints", policy_from=policy)


def dynamics() -> Trained:
    return train_dynamics(experience_of(MAZE.actions).data, DYNAMICS, "checkpoints")


class Killed(BaseException):
    """Not an Exception: nothing in between may take it for a failure that it can handle."""


@pytest.fixture(autouse=True)
def at_every_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)


def counted(monkeypatch: pytest.MonkeyPatch, at_most: float = np.inf) -> list[int]:
    """The updates that are made from now on; after so many the training is killed."""
    done: list[int] = []
    record = CurveLog.record

    def count(log: CurveLog, update: int, values: dict[str, Tensor]) -> None:
        if len(done) >= at_most:
            raise Killed
        done.append(update)
        record(log, update, values)

    monkeypatch.setattr(CurveLog, "record", count)
    return done


def kept_in(folder: Path) -> list[Path]:
    """Checkpoints, without what tells how far trainings are."""
    return [file for file in folder.iterdir() if not file.name.endswith(NEWS)]


def assert_same(found: Trained, expected: Trained) -> None:
    assert found.weights.keys() == expected.weights.keys()
    for name, array in expected.weights.items():
        assert found.weights[name].tobytes() == array.tobytes(), name
    assert found.curves == expected.curves


@pytest.mark.parametrize("train", [agent, single_tasks, gaussian, dynamics])
@pytest.mark.parametrize("killed_after", [300, 2 * DRAWN_AT_ONCE])
def test_a_killed_training_goes_on_to_the_same_bytes(
    train: Callable[[], Trained],
    killed_after: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected = train()
    with checkpoints_by(Checkpoints(tmp_path / "own").of):
        with monkeypatch.context() as patch:
            counted(patch, killed_after)
            with pytest.raises(Killed):
                train()
        with monkeypatch.context() as patch:
            again = counted(patch)
            resumed = train()
    assert again[0] == killed_after // DRAWN_AT_ONCE * DRAWN_AT_ONCE
    assert_same(resumed, expected)


def test_a_finished_training_is_not_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with checkpoints_by(Checkpoints(tmp_path / "own").of):
        first = agent()
        done = counted(monkeypatch)
        assert_same(agent(), first)
    assert done == []


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_checkpoint_counts_as_none(
    damage: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with checkpoints_by(Checkpoints(tmp_path / "own").of):
        expected = dynamics()
        (file,) = kept_in(tmp_path / "own")
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(bytes(content) if damage is None else damage)
        done = counted(monkeypatch)
        assert_same(dynamics(), expected)
    assert done == list(range(UPDATES))


def test_nothing_is_left_where_nobody_asked(tmp_path: Path) -> None:
    assert checkpoint_of(("x",)) is None
    with checkpoints_by(Checkpoints(tmp_path / "not-there" / "own").of):
        assert checkpoint_of(("x",)) is None
        dynamics()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_may_not_be_looked_into_counts_as_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    with checkpoints_by(Checkpoints(tmp_path / "own").of), monkeypatch.context() as patch:
        patch.setattr(os, "stat", refused)
        assert checkpoint_of(("x",)) is None


def test_no_checkpoint_before_a_minute_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training, "SECONDS_BETWEEN_CHECKPOINTS", 3600.0)
    with checkpoints_by(Checkpoints(tmp_path / "own").of):
        dynamics()
    assert kept_in(tmp_path / "own") == []


def test_other_machines_have_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Checkpoints(tmp_path / "own")
    here = kept.of(("x",))
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "ANOTHER")
    assert kept.of(("x",)) != here


def test_a_folder_that_takes_nothing_costs_the_checkpoint_alone(tmp_path: Path) -> None:
    (tmp_path / "own").write_text("a file where the folder should be")
    expected = dynamics()
    with checkpoints_by(Checkpoints(tmp_path / "own").of):
        assert_same(dynamics(), expected)


def test_trainings_of_other_labels_have_their_own(tmp_path: Path) -> None:
    kept = Checkpoints(tmp_path / "own")
    first = kept.of(("agent", 0))
    assert first is not None
    assert first != kept.of(("agent", 1))
    assert first == kept.of(("agent", 0))
    assert first == kept.of(("agent", np.int64(0)))  # type: ignore[arg-type]


def test_what_earlier_attempts_took_is_counted(tmp_path: Path) -> None:
    first = Checkpoints(tmp_path / "own")
    first._started -= 100.0
    with checkpoints_by(first.of):
        dynamics()
    assert first.earlier == 0.0
    second = Checkpoints(tmp_path / "own")
    with checkpoints_by(second.of):
        dynamics()
    assert second.earlier >= 100.0
    assert second.spent >= second.earlier


def test_a_whole_file_of_another_format_counts_as_none(tmp_path: Path) -> None:
    kept = Checkpoints(tmp_path / "own").of(("x",))
    assert isinstance(kept, CheckpointFile)
    data = save({"model.w": torch.zeros(2)})
    kept.path.parent.mkdir()
    kept.path.write_bytes(hashlib.sha256(data).digest() + data)
    assert kept.read() is None
