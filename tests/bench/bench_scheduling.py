"""What the driver itself costs: planning a block, and taking it from queued to recorded.

Real plans of Table 1 with ever more seeds, the real driver and real ledgers; only the outcomes are
made up (every skill succeeds, so the whole tree is walked) and arrive at once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import numpy as np

from orchestrator.spec.spec import load_spec
from orchestrator.storage.ledger import Ledger, Outcome
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.evaluation import Evaluation
from orchestrator.work.jobs import BlockReport, Job, PlayJob, Report
from orchestrator.work.plan import Plan, make_plan
from orchestrator.work.progress import Silent
from stitching.envs.maze import MAZE
from tests.bench.result import Result

# 244 blocks each: about 10³, 10⁴ and 10⁵. The small ones come before and after the large one, so
# that a machine which slows down meanwhile is not taken for a driver that does.
SEEDS = (4, 41, 4, 410, 4, 41, 4)
FLAT = 1.25  # up to this a ratio is noise


class Untrained(Store):
    """Has any model that is asked for, and nothing in it: nobody plays with them."""

    def read(self, kind: str, key: str) -> Artifact:
        return Artifact({}, {})


class Prophet:
    """An executor that knows every outcome beforehand."""

    workers = 2

    def __init__(self, episodes: int) -> None:
        self._episodes = episodes
        self._outcome = _success(episodes).to_bytes()
        self._jobs: deque[PlayJob] = deque()

    def provide(self, key: str, artifact: Artifact) -> None: ...

    def submit(self, job: Job) -> None:
        assert isinstance(job, PlayJob)
        self._jobs.append(job)

    def next(self) -> Report:
        job = self._jobs.popleft()
        blocks = (
            BlockReport(task.key, self._outcome, segments=self._episodes) for task, _ in job.tasks
        )
        return Report(job, blocks=tuple(blocks))

    def close(self) -> None: ...


def _success(episodes: int) -> Outcome:
    """Shaped as `worker.BlockPlayer` makes them."""
    rng = np.random.default_rng(0)
    steps = rng.integers(1, 20, size=episodes)
    return Outcome(
        {
            "episode": np.arange(episodes),
            "success": np.ones(episodes, dtype=bool),
            "stitch_steps": rng.integers(5, size=episodes),
            "steps": steps,
            "end_step": steps,
            "value_start": rng.random(episodes, dtype=np.float32),
            "value_end": rng.random(episodes, dtype=np.float32),
            "snapshots": rng.random((episodes, MAZE.snapshot_size)),
        }
    )


def measure() -> Iterator[Result]:
    _plan_and_drive(1)  # the code is fingerprinted once a process, whatever the size of the plan
    runs = sorted(_plan_and_drive(seeds) for seeds in SEEDS)
    of_a_size = [list(runs) for _, runs in groupby(runs, key=itemgetter(0))]
    rows = [[median(column) for column in zip(*runs, strict=True)] for runs in of_a_size]
    blocks, planning, driving, computing = zip(*rows, strict=True)
    for measured, spent in (
        ("driver's loop, by the clock", driving),
        ("driver's loop, CPU", computing),
        ("expanding the plan, CPU", planning),
    ):
        yield Result(
            "scheduling",
            f"{measured}, a block: {blocks[-1]:,.0f} blocks over {blocks[0]:,.0f}",
            {f"µs at {n:,.0f}": each for n, each in zip(blocks, spent, strict=True)},
            ratio=spent[-1] / spent[0],
            at_most=FLAT,
        )


def _plan_and_drive(seeds: int) -> tuple[float, ...]:
    """Blocks of a plan, and the microseconds of each: planning (CPU), driving (clock, CPU)."""
    began = process_time()
    plan = make_plan(replace(load_spec("table1", "quick"), seeds=seeds))
    blocks = len(plan.tasks)
    seconds = process_time() - began, *_drive(plan)
    return blocks, *(1e6 * each / blocks for each in seconds)


def _drive(plan: Plan) -> tuple[float, float]:
    """Seconds from the first block queued to the last one recorded: of the clock, and of CPU."""
    with (
        TemporaryDirectory() as folder,
        closing(Ledger(Path(folder, "ledger.sqlite"))) as ledger,
        closing(Ledger(Path(folder, "blocks.sqlite"))) as shared,
    ):
        executor = Prophet(plan.spec.episodes)
        evaluation = Evaluation(plan, Untrained(Path(folder)), ledger, shared, executor, Silent())
        clock, cpu = perf_counter(), process_time()
        evaluation.run()
        seconds = perf_counter() - clock, process_time() - cpu
        assert len(ledger.finished()) == len(plan.tasks)
    return seconds
