"""The same bytes, however the work is divided, ordered, shared or stripped of its tree."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from orchestrator import reproduction as reproducing
from orchestrator.executors.serial import SerialExecutor
from orchestrator.reproduction import Settings
from orchestrator.spec.spec import Spec
from orchestrator.work.jobs import Report
from orchestrator.work.plan import make_plan
from tests.orchestrator.tiny import Alone, Lines, Place, carry_out, promised_bytes, serially
from tests.rows import row

METHODS = ("no-stitch", "random-stitch", "mf-stitch", "mb-stitch", "reach-stitch")


@pytest.fixture(scope="module", params=[False, True], ids=["between skills", "first, too"])
def deep(spec: Spec, request: pytest.FixtureRequest) -> Spec:
    """Three skills deep, so that stitched segments have stitched parents."""
    rollout = replace(spec.rollout, first_stitch=request.param)
    return replace(spec, methods=METHODS, lengths=(2, 3), tasks=(), rollout=rollout)


@pytest.fixture(scope="module")
def serial(deep: Spec, tmp_path_factory: pytest.TempPathFactory) -> Place:
    place = Place(tmp_path_factory.mktemp("serial"))
    place.carry_out(deep)
    return place


@pytest.fixture(scope="module")
def expected(serial: Place) -> dict[str, bytes]:
    return promised_bytes(serial.out)


def artifact_digests(place: Place) -> dict[str, str]:
    return {
        f"{kind} {key}": place.store.read(kind, key).digest for kind, key in place.store.artifacts()
    }


def test_the_problem_is_worth_comparing(serial: Place, deep: Spec) -> None:
    """Every method has episodes that pass and episodes that fail beyond the first skill."""
    segments = pd.read_parquet(serial.out / "segments.parquet")
    later = segments[segments["depth"] > 1]
    assert set(later["method"]) == set(deep.methods) == set(METHODS)
    assert later.groupby("method")["success"].mean().between(0.01, 0.99).all()
    stitches = later.groupby("method")["stitch_steps"].sum()
    assert (stitches.drop("no-stitch") > 0).all()
    assert stitches["no-stitch"] == 0
    assert (segments["depth"] == 3).any()
    first = segments[segments["depth"] == 1]
    stitched = {"random-stitch", "mb-stitch"} if deep.rollout.first_stitch else set()
    # Reach-Stitch's first skills are its own, too, but every skill begins at the start cell.
    own = {*stitched, "reach-stitch"} if stitched else set()
    assert set(first["method"]) == {"", *own}
    assert set(first.loc[first["stitch_steps"] > 0, "method"]) == stitched


class Scrambled(SerialExecutor):
    """Three workers that finish in an order of their own."""

    workers = 3

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._order = np.random.default_rng(seed)

    def next(self) -> Report:
        self._jobs.rotate(int(self._order.integers(len(self._jobs))))
        return super().next()


def test_any_order_of_arrival(
    deep: Spec,
    serial: Place,
    expected: dict[str, bytes],
    place: Place,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reproducing, "open_executor", lambda *_: Scrambled(seed=0))
    place.carry_out(deep)
    assert promised_bytes(place.out) == expected
    assert artifact_digests(place) == artifact_digests(serial)


def test_blocks_taken_over_from_a_smaller_run(
    deep: Spec, expected: dict[str, bytes], done: Place
) -> None:
    out, lines = done.root / "deep", Lines()
    carry_out(deep, serially(out, done.store_root), lines)
    assert lines.phases["training"] == (9, 8)  # initiation sets are new
    assert lines.phases["illustrations"] == (1, 0)  # it shows a longer task
    assert promised_bytes(out) == expected


@pytest.mark.ray
@pytest.mark.parametrize("workers", [1, 2])
def test_ray(
    deep: Spec,
    serial: Place,
    expected: dict[str, bytes],
    place: Place,
    shared_ray: None,
    workers: int,
) -> None:
    settings = Settings(
        place.out, place.store_root, executor="ray", workers=workers, tracking_uri="none"
    )
    directory = carry_out(deep, settings)
    assert directory.read_json("provenance.json")["workers"] == workers
    assert promised_bytes(place.out) == expected
    assert artifact_digests(place) == artifact_digests(serial)


def sample(spec: Spec, place: Place, seed: int, method: str) -> list[Alone]:
    """Some tasks of each length, every chunk of their episodes."""
    plan = make_plan(spec)
    rng = np.random.default_rng(seed)
    chosen = [spec.all_tasks[i] for i in rng.choice(len(spec.all_tasks), size=12, replace=False)]
    return [
        Alone(plan, place, seed, method, task, chunk)
        for task in chosen
        for chunk in range(len(plan.chunks))
    ]


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("method", METHODS)
def test_tasks_played_without_the_tree(deep: Spec, serial: Place, method: str, seed: int) -> None:
    stitched = 0
    for alone in sample(deep, serial, seed, method):
        stitched += alone.depth_of_the_same_bytes() > 1
    assert stitched


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("method", METHODS)
def test_a_shorter_limit_is_read_off_the_tree(
    deep: Spec, serial: Place, method: str, seed: int
) -> None:
    """Tasks of two skills may take 20 steps, the tree is played to 30: cutting must be exact."""
    episodes = pd.read_parquet(serial.out / "episodes.parquet")
    episodes = episodes.set_index(["seed", "method", "task", "episode"])
    cut = 0
    for alone in sample(deep, serial, seed, method):
        limit = deep.step_limits[len(alone.task)]
        alive = np.arange(*alone.plan.chunks[alone.chunk])
        accomplished = dict.fromkeys(alive.tolist(), 0)
        for segments in alone.play(limit):
            alive = alive[segments.success]
            for episode in alive.tolist():
                accomplished[episode] += 1
        for episode, count in accomplished.items():
            played = row(episodes, seed, method, ">".join(alone.task), episode)
            assert played["accomplished"] == count
            cut += bool(played["steps"] == limit < deep.step_limit)
    assert cut
