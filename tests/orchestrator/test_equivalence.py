"""The same bytes, however the work is divided, ordered, shared or stripped of its tree."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import Place
from tiny import Lines, promised_bytes

from orchestrator import reproduce as reproducing
from orchestrator.builders import load_models
from orchestrator.driver import Silent
from orchestrator.executors import open_executor
from orchestrator.executors.protocol import Executor
from orchestrator.executors.serial import SerialExecutor
from orchestrator.jobs import Report
from orchestrator.methods import make_stitcher, method_name
from orchestrator.plan import Node, make_plan
from orchestrator.reproduce import Settings, reproduce
from orchestrator.spec import Spec
from orchestrator.structure import to_plain
from stitching.envs.registry import BENCHMARKS
from stitching.rollout import Play, play_from_start


@pytest.fixture(scope="module")
def deep(spec: Spec) -> Spec:
    """Three skills deep, so that stitched segments have stitched parents."""
    return replace(spec, lengths=(2, 3))


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
    rates = later.groupby("method")["success"].mean()
    assert set(rates.index) == set(deep.methods)
    assert rates.between(0.01, 0.99).all()
    assert (later[later["method"] != "no-stitch"]["stitch_steps"] > 0).any()
    assert (segments["depth"] == 3).any()


class Scrambled(SerialExecutor):
    """Three workers that finish in an order of their own."""

    workers = 3

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._order = np.random.default_rng(seed)

    def next(self) -> Report:
        self._jobs.rotate(int(self._order.integers(len(self._jobs))))
        return super().next()


@pytest.mark.parametrize("seed", range(2))
def test_any_order_of_arrival_gives_the_same_bytes(
    deep: Spec,
    serial: Place,
    expected: dict[str, bytes],
    place: Place,
    monkeypatch: pytest.MonkeyPatch,
    seed: int,
) -> None:
    monkeypatch.setattr(reproducing, "open_executor", lambda *_: Scrambled(seed))
    place.carry_out(deep)
    assert promised_bytes(place.out) == expected
    assert artifact_digests(place) == artifact_digests(serial)


def test_blocks_shared_with_a_smaller_run_give_the_same_bytes(
    deep: Spec, expected: dict[str, bytes], done: Place
) -> None:
    """`done` has played the pairs alone; the triples build on its blocks."""
    lines = Lines()
    out = done.root / "deep"
    settings = Settings(out, done.store_root, executor="serial", tracking_uri="none")
    reproduce(replace(deep, step_limits={2: 20, 3: 30}), settings, lines)
    assert promised_bytes(out) == expected
    assert lines.phases["training"][1] > 0


@pytest.fixture(scope="module")
def ray_of_two() -> Iterator[Executor]:
    """Ray on two cores; executors opened meanwhile join it, up to the workers they ask for."""
    executor = open_executor("ray", 2, None)
    yield executor
    executor.close()


@pytest.mark.ray
@pytest.mark.parametrize("workers", [1, 2])
def test_ray_gives_the_same_bytes(
    deep: Spec,
    serial: Place,
    expected: dict[str, bytes],
    place: Place,
    ray_of_two: Executor,
    workers: int,
) -> None:
    settings = Settings(
        place.out, place.store_root, executor="ray", workers=workers, tracking_uri="none"
    )
    directory = reproduce(deep, settings, Silent())
    assert directory.read_json("provenance.json")["workers"] == workers
    assert promised_bytes(place.out) == expected
    assert artifact_digests(place) == artifact_digests(serial)


TASKS = ("g0>g1", "g1>g3", "g2>g1", "g0>g1>g3", "g3>g2>g1", "g1>g0>g2")


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("method", ["no-stitch", "random-stitch", "mf-stitch", "mb-stitch"])
def test_tasks_played_from_the_start_without_the_tree(
    deep: Spec, serial: Place, method: str, seed: int
) -> None:
    """Step by step what the ledger holds, and, cut at its own limit, what the episodes say."""
    plan = make_plan(deep)
    benchmark = BENCHMARKS[deep.benchmark]
    episodes = pd.read_parquet(serial.out / "episodes.parquet")
    ledger = serial.directory.ledger(read_only=True)
    played_beyond_the_first = 0
    for text in TASKS:
        task = tuple(text.split(">"))
        for chunk, (first, end) in enumerate(plan.chunks):
            block_task = plan.tasks[Node(seed, method, task[:2]), chunk]
            models = load_models(
                benchmark,
                block_task.configs,
                {k: serial.store.read(k, key) for k, key in block_task.artifacts.items()},
            )
            stitcher = make_stitcher(
                method,
                to_plain(deep.method_config(method)),
                benchmark,
                models["agent"],
                models,
            )
            play = Play(
                deep.root_seed,
                deep.benchmark,
                seed,
                method_name(method),
                tuple(range(first, end)),
                task,
            )

            def from_start(limit: int, play: Play = play, *with_models: object) -> list:
                agent, stitcher = with_models
                return play_from_start(
                    benchmark.block(), agent, stitcher, benchmark, deep.rollout, play, limit
                )

            segments = from_start(deep.step_limit, play, models["agent"], stitcher)
            used = np.zeros(end - first, dtype=np.int64)
            for depth, segment in enumerate(segments, start=1):
                node = Node(seed, method if depth > 1 else "", task[:depth])
                key = plan.tasks[node, chunk].key
                ((_, outcome),) = ledger.outcomes([key])
                arrays = outcome.arrays
                for name in ("success", "stitch_steps", "steps", "value_start", "value_end"):
                    assert arrays[name].tobytes() == getattr(segment, name).tobytes(), (text, name)
                    assert arrays[name].dtype == getattr(segment, name).dtype
                reached = segment.snapshots[segment.success]
                assert arrays["snapshots"].tobytes() == reached.tobytes()
                assert (arrays["end_step"] == used + segment.steps).all()
                used = (used + segment.steps)[segment.success]
                played_beyond_the_first += depth > 1 and len(segment.steps)
    ledger.close()
    assert played_beyond_the_first
    assert len(episodes)
    shutil.rmtree(Path("/nonexistent"), ignore_errors=True)
