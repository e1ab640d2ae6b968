"""What a person is told while work goes on."""

import io
import math
import re
import time
from pathlib import Path

import pytest
from rich.console import Console

from orchestrator.storage.store import Store
from orchestrator.work import checkpoints, progress
from orchestrator.work.building import Trainings
from orchestrator.work.checkpoints import CheckpointFile, Checkpoints, news_of
from orchestrator.work.progress import ConsoleProgress
from orchestrator.work.recipes import Recipe
from stitching.envs.protocol import ActionSpace
from stitching.models.checkpoints import checkpoints_by
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from tests.stitching.models.test_iql import experience_of


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.02)
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LOOKS", 0.01)


def lines_of(console: Console) -> list[str]:
    file = console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue().splitlines()


@pytest.mark.usefixtures("impatient")
def test_without_a_terminal_there_are_lines_while_nothing_is_finished() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: "agent seed 0"):
            time.sleep(0.3)
    first, *others = lines_of(console)
    assert first == "training: 1 of 3 already there"
    assert len(others) > 2
    assert all(line.startswith("training: 1/3 after ") for line in others)
    assert all(line.endswith("; agent seed 0") for line in others)


@pytest.mark.usefixtures("impatient")
def test_on_a_terminal_the_bar_says_it() -> None:
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: "agent seed 0"):
            time.sleep(0.3)
    assert "agent seed 0" in "".join(lines_of(console))
    assert "already there" not in "".join(lines_of(console))


def test_a_training_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN_NEWS", 0.0)
    store = Store(tmp_path)
    folder = store.checkpoints("key")
    trainings = Trainings(store, {"key": Recipe("dynamics", {"seed": 2})})
    assert trainings.told(["key"]) == ""
    config = DynamicsConfig(updates=20, width=8, members=2, log_every=5)
    with checkpoints_by(Checkpoints(folder).of):
        train_dynamics(experience_of(ActionSpace(2, discrete=False)).data, config, "seed", 2)
    news = news_of(folder)
    assert news is not None
    assert (news.done, news.updates) == (20, 20)
    assert news.losses
    assert trainings.told(["key"]).startswith("dynamics, seed 2: 20 of 20 updates, ")


def test_the_rate_is_that_since_the_first_look(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folder = store.checkpoints("key")
    file, trainings = (
        CheckpointFile(folder / "x", Checkpoints(folder)),
        Trainings(store, {"key": Recipe("agent", {"seed": 0})}),
    )

    def told(done: int) -> str:
        file._told = -math.inf  # whatever was told just before
        file.tell(done, 5000, {"loss": [(1, 0.5)]})
        return trainings.told(["key"])

    assert told(1000) == "agent, seed 0: 1,000 of 5,000 updates, loss 0.5"
    time.sleep(0.1)
    assert re.fullmatch(r"agent, seed 0: 2,000 of 5,000 updates \(\d+/s\), loss 0.5", told(2000))
    assert told(500) == "agent, seed 0: 500 of 5,000 updates, loss 0.5"  # it began again


def test_what_an_earlier_attempt_told_does_not_count(tmp_path: Path) -> None:
    CheckpointFile(tmp_path / "x", Checkpoints(tmp_path)).tell(5, 5, {})
    assert news_of(tmp_path) is not None
    assert news_of(tmp_path, since=time.time() + 60) is None


@pytest.mark.usefixtures("impatient")
def test_a_look_that_fails_disturbs_nothing() -> None:
    def look() -> str:
        raise OSError("the folder is gone")

    console = Console(file=io.StringIO(), width=200)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(look):
            time.sleep(0.2)
    assert len(lines_of(console)) > 2
    assert all("gone" not in line for line in lines_of(console))


def test_what_cannot_be_read_tells_nothing(tmp_path: Path) -> None:
    (tmp_path / "torn.news").write_text('{"done": 1')
    assert news_of(tmp_path) is None
    assert news_of(tmp_path / "nowhere") is None
    sealed = tmp_path / "file"
    sealed.write_text("")
    CheckpointFile(sealed / "below", Checkpoints(None)).tell(1, 2, {})  # raises nothing
    assert news_of(sealed) is None
