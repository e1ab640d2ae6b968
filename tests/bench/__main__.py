"""`make bench`: the ratios that the documentation quotes, each within one run.

    python -m tests.bench [iql planner reference outside tree speedup scheduling
                           robosuite] [--run DIR] [--json FILE]

Read the ratios, not the numbers behind them, which belong to the machine.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from orchestrator.work.worker import use_one_thread
from tests.bench import (
    bench_iql,
    bench_planner,
    bench_reference_planner,
    bench_robosuite,
    bench_run,
    bench_scheduling,
    bench_speedup,
)
from tests.bench.result import HEADER, Result

Name = Literal[
    "iql", "planner", "reference", "outside", "tree", "speedup", "scheduling", "robosuite"
]
ALL: tuple[Name, ...] = get_args(Name)


def main(
    names: tyro.conf.Positional[tuple[Name, ...]] = ALL,
    run: Path | None = None,
    json_: Annotated[Path | None, tyro.conf.arg(name="json")] = None,
) -> None:
    """Measure, and print one table.

    Args:
        names: what to measure.
        run: a finished run directory for `outside` and `tree`; else a quick run is made. One of
            Kitchen lends `reference` its models; they are untrained else.
        json_: where to write the same as JSON.
    """
    benches: dict[Name, Callable[[], Iterator[Result]]] = {
        "iql": bench_iql.measure,
        "planner": bench_planner.measure,
        "reference": partial(bench_reference_planner.measure, run),
        "outside": partial(bench_run.outside, run),
        "tree": partial(bench_run.tree, run),
        "speedup": bench_speedup.measure,
        "scheduling": bench_scheduling.measure,
        "robosuite": bench_robosuite.measure,
    }
    use_one_thread()
    results = []
    print(HEADER)
    for name in names:
        for result in benches[name]():
            results.append(result)
            print(result.lines(), flush=True)
    if json_ is not None:
        rows = [asdict(r) | {"target": r.target, "met": r.met} for r in results]
        json_.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    tyro.cli(main, prog="python -m tests.bench")
