"""What is known of trainings while they go on."""

import math
import re
import time
from pathlib import Path
from typing import Any

import pytest

from orchestrator.storage.store import Store
from orchestrator.work import checkpoints
from orchestrator.work.checkpoints import CheckpointFile, Checkpoints, news_of
from orchestrator.work.progress import UnderWay
from orchestrator.work.recipes import Recipe
from orchestrator.work.trainings import Trainings
from stitching.envs.protocol import ActionSpace
from stitching.models.checkpoints import checkpoints_by
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from tests.stitching.models.test_iql import experience_of


def recipe(kind: str, seed: int, **config: Any) -> Recipe:
    return Recipe(kind, {"benchmark": "maze", "seed": seed, "config": config})


def test_a_training_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN_NEWS", 0.0)
    store = Store(tmp_path)
    folder = store.checkpoints("key")
    trainings = Trainings(store, {"key": recipe("dynamics", 2, updates=20)}, skills=4)
    assert trainings.under_way([], ["key"]) == UnderWay("", 0.0)
    config = DynamicsConfig(updates=20, width=8, members=2, log_every=5)
    with checkpoints_by(Checkpoints(folder).of):
        train_dynamics(experience_of(ActionSpace(2, discrete=False)).data, config, "seed", 2)
    news = news_of(folder)
    assert news is not None
    assert (news.done, news.updates) == (20, 20)
    assert news.losses
    under_way = trainings.under_way([], ["key"])
    assert under_way.told.startswith("dynamics, seed 2: 20 of 20 updates, ")
    assert under_way.share == 1.0


def test_the_rate_is_that_since_the_first_look(tmp_path: Path) -> None:
    store = Store(tmp_path)
    folder = store.checkpoints("key")
    file, trainings = (
        CheckpointFile(folder / "x", Checkpoints(folder)),
        Trainings(store, {"key": recipe("agent", 0, updates=5000)}, skills=4),
    )

    def told(done: int) -> str:
        file._told = -math.inf  # whatever was told just before
        file.tell(done, 5000, {"loss": [(1, 0.5)]})
        return trainings.under_way([], ["key"]).told

    assert told(1000) == "agent, seed 0: 1,000 of 5,000 updates, loss 0.5"
    time.sleep(0.1)
    assert re.fullmatch(r"agent, seed 0: 2,000 of 5,000 updates \(\d+/s\), loss 0.5", told(2000))
    assert told(500) == "agent, seed 0: 500 of 5,000 updates, loss 0.5"  # it began again


def test_the_share_is_by_what_trainings_take(tmp_path: Path) -> None:
    """A long training half done is more than a short one that is finished."""
    store = Store(tmp_path)
    recipes = {
        "long": recipe("agent", 0, updates=3000),
        "short": recipe("agent", 1, updates=1000),
        "waiting": recipe("agent", 2, updates=1000),
    }
    trainings = Trainings(store, recipes, skills=4)
    folder = store.checkpoints("long")
    CheckpointFile(folder / "x", Checkpoints(folder)).tell(1500, 3000, {})
    assert trainings.under_way([], []).share == 0
    assert trainings.under_way(["short"], ["long"]).share == pytest.approx(2500 / 5000)
    assert trainings.under_way(recipes, []).share == 1.0


def test_networks_of_one_skill_each_are_a_training_each(tmp_path: Path) -> None:
    store = Store(tmp_path)
    trainings = Trainings(store, {"key": recipe("agent", 0, updates=100, multi_task=False)}, 4)
    folder = store.checkpoints("key")
    for name, done in (("first", 100), ("second", 50)):
        CheckpointFile(folder / name, Checkpoints(folder)).tell(done, 100, {})
        time.sleep(0.01)
    CheckpointFile(folder / "second", Checkpoints(folder)).tell(50, 100, {})
    under_way = trainings.under_way([], ["key"])
    assert under_way.told == "agent, seed 0: 150 of 400 updates"
    assert under_way.share == pytest.approx(150 / 400)


def test_what_an_earlier_attempt_told_does_not_count(tmp_path: Path) -> None:
    CheckpointFile(tmp_path / "x", Checkpoints(tmp_path)).tell(5, 5, {})
    assert news_of(tmp_path) is not None
    assert news_of(tmp_path, since=time.time() + 60) is None


def test_what_cannot_be_read_tells_nothing(tmp_path: Path) -> None:
    (tmp_path / "torn.news").write_text('{"done": 1')
    assert news_of(tmp_path) is None
    assert news_of(tmp_path / "nowhere") is None
    sealed = tmp_path / "file"
    sealed.write_text("")
    CheckpointFile(sealed / "below", Checkpoints(None)).tell(1, 2, {})  # raises nothing
    assert news_of(sealed) is None
