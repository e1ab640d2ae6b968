"""Two workers against one: wall seconds of training and evaluation under Ray, start-up apart.

The ratio compares two runs, so it needs a machine with two cores to spare. How many workers were
busy on average belongs to each run by itself and says about the same on a machine that has not.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.bench.result import Result
from tests.bench.runs import carry_out

# About 40 seconds of one core, in pieces of which even the largest is small beside the whole.
WORK = """
    --scale quick --seeds 4 --episodes 40 --tracking-uri none
    --agent.updates 500 --dynamics.updates 400 --mf-stitch.training.updates 400
"""


def measure() -> Iterator[Result]:
    with TemporaryDirectory() as folder:
        one, two = (
            carry_out(Path(folder, str(workers)), "--workers", str(workers), *WORK.split())
            for workers in (1, 2)
        )
    yield Result(
        "speedup",
        "training and evaluation: 2 workers over 1",
        {
            f"{what}, of {run.workers}": number
            for run in (one, two)
            for what, number in (
                ("s training", run.seconds["training"]),
                ("s evaluation", run.seconds["evaluation"]),
                ("s of workers", sum(run.busy.values())),
                ("busy workers", run.busy_workers),
            )
        },
        ratio=one.working / two.working,
        at_least=1.8,
    )
