"""What is known of trainings while they go on."""

import math
import re
import time
from pathlib import Path
from typing import Any

import pytest

from orchestrator.spec.spec import Spec
from orchestrator.storage.store import Artifact, Store
from orchestrator.work import checkpoints
from orchestrator.work.checkpoints import CheckpointFile, Checkpoints, news_of
from orchestrator.work.plan import make_plan
from orchestrator.work.progress import UnderWay
from orchestrator.work.recipes import Recipe
from orchestrator.work.trainings import GrowingCurves, Trainings
from stitching.envs.protocol import ActionSpace
from stitching.models.checkpoints import checkpoints_by
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from tests.orchestrator.tiny import Place
from tests.stitching.models.test_iql import experience_of


def recipe(kind: str, seed: int, **config: Any) -> Recipe:
    return Recipe(kind, {"benchmark": "maze", "seed": seed, "config": config})


def alone(store: Store, of: Recipe) -> Trainings:
    """The training of an artifact under the key "key"."""
    return Trainings(store, {"key": of}, {"key"}, skills=4, _since=0.0)


def test_a_training_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN_NEWS", 0.0)
    store = Store(tmp_path)
    folder = store.checkpoints("key")
    trainings = alone(store, recipe("dynamics", 2, updates=20))
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
    file = CheckpointFile(folder / "x", Checkpoints(folder))
    trainings = alone(store, recipe("agent", 0, updates=5000))

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
    trainings = Trainings(store, recipes, recipes, skills=4, _since=0.0)
    folder = store.checkpoints("long")
    CheckpointFile(folder / "x", Checkpoints(folder)).tell(1500, 3000, {})
    assert trainings.under_way([], []).share == 0
    assert trainings.under_way(["short"], ["long"]).share == pytest.approx(2500 / 5000)
    assert trainings.under_way(recipes, []).share == 1.0


def test_what_trainings_took_is_known_though_their_data_are_there(tmp_path: Path) -> None:
    """Of a run that goes on: its data are not made again, and are part of what is alike."""
    store = Store(tmp_path)

    def recipes(seed: int) -> dict[str, Recipe]:
        data = Recipe("maze-demonstrations", {"benchmark": "maze", "root_seed": seed})
        config = {"config": {"updates": 1000}, "benchmark": "maze", "seed": seed}
        inputs = {"demonstrations": data.key}
        models = {kind: Recipe(kind, config, inputs) for kind in ("agent", "dynamics")}
        return {"data": data, **models}

    for of, seconds in zip(recipes(0).values(), (1.0, 90.0, 10.0), strict=True):
        made = {"kind": of.kind, "params": of.params, "inputs": of.inputs, "seconds": seconds}
        store.write(of.kind, of.key, Artifact({}, {}), made)
    now = recipes(1)
    by_key = {of.key: of for of in now.values()}
    wanted = {now["agent"].key, now["dynamics"].key}
    trainings = Trainings(store, by_key, wanted, skills=4, _since=0.0)
    assert trainings.under_way([now["agent"].key], []).share == pytest.approx(0.9)


def test_networks_of_one_skill_each_are_a_training_each(tmp_path: Path) -> None:
    store = Store(tmp_path)
    trainings = alone(store, recipe("agent", 0, updates=100, multi_task=False))
    folder = store.checkpoints("key")
    for name, done in (("first", 100), ("second", 50)):
        CheckpointFile(folder / name, Checkpoints(folder)).tell(done, 100, {})
        time.sleep(0.01)
    CheckpointFile(folder / "second", Checkpoints(folder)).tell(50, 100, {})
    under_way = trainings.under_way([], ["key"])
    assert under_way.told == "agent, seed 0: 150 of 400 updates"
    assert under_way.share == pytest.approx(150 / 400)


def test_curves_of_trainings_under_way_are_as_they_will_be(place: Place, spec: Spec) -> None:
    """What a training tells last is what its artifact holds."""
    plan = make_plan(spec)
    (key,) = (
        key
        for key, one in plan.recipes.items()
        if one.kind == "dynamics" and one.params["seed"] == 0
    )
    growing = GrowingCurves(plan, place.store, _since=0.0)
    entries = {entry["key"]: entry for entry in growing.entries()}
    assert set(entries) == {
        key for key in plan.needed if plan.recipes[key].kind in ("agent", "dynamics", "mf-policy")
    }
    assert not any(entry["curves"] for entry in entries.values())

    folder = place.store.checkpoints(key)
    training = Checkpoints(folder).of(("dynamics", "maze", spec.root_seed, 0))
    assert training is not None
    training.tell(5, 5, {"loss": [(1, 0.25), (5, 0.1)]})
    (grown,) = [entry for entry in growing.entries() if entry["curves"]]
    assert grown == {
        "kind": "dynamics", "seed": 0, "key": key, "curves": {"loss": [[1, 0.25], [5, 0.1]]}
    }  # fmt: skip

    artifact = Artifact({}, {"curves": {"loss": [[1, 0.25], [5, 0.1], [9, 0.05]]}})
    place.store.write("dynamics", key, artifact, {})
    (finished,) = [entry for entry in growing.entries() if entry["curves"]]
    assert finished["curves"]["loss"][-1] == [9, 0.05]


def test_curves_of_several_trainings_are_named_as_in_their_artifact(
    place: Place, spec: Spec
) -> None:
    """Those of pairs of skills are means in the end, which are not known before."""
    plan = make_plan(spec)
    for key in plan.needed:
        one = plan.recipes[key]
        if one.kind in ("agent", "mf-policy"):
            labels = (one.kind, "maze", spec.root_seed, one.params["seed"], 2)
            training = Checkpoints(place.store.checkpoints(key)).of(labels)
            assert training is not None
            training.tell(5, 5, {"loss": [(1, 0.25)]})
    entries = GrowingCurves(plan, place.store, _since=0.0).entries()
    curves = {entry["kind"]: entry["curves"] for entry in entries}
    assert curves["agent"] == {"loss of skill 2": [[1, 0.25]]}
    assert curves["mf-policy"] == {}


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
