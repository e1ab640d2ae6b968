"""A whole run of Table 1: what is not training or simulation, and what the tree saves."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from tests.bench.result import Result
from tests.bench.runs import Run, carry_out, read


def outside(directory: Path | None) -> Iterator[Result]:
    """The target is for the paper's scale: the fixed costs of a smaller run weigh more."""
    run = _run(directory)
    loading = _seconds_to_load()
    whole = sum(run.seconds.values()) + loading
    yield Result(
        "outside",
        f"{_name(run, directory)}: wall time outside training and simulation, share",
        {
            "s in all": whole,
            **dict(sorted(run.seconds.items(), key=lambda phase: -phase[1])),
            "loading Python": loading,
            f"busy workers of {run.workers}": run.busy_workers,
        },
        ratio=1 - run.working / whole,
        at_most=0.1 if run.scale == "paper" else None,
    )


def tree(directory: Path | None) -> Iterator[Result]:
    run = _run(directory)
    for unit, without, within in (
        ("segments", run.segments_without_tree, run.segments),
        ("environment steps", run.steps_without_tree, run.steps),
    ):
        yield Result(
            "tree",
            f"{_name(run, directory)}: {unit} without the tree over with it",
            {"without": without, "with": within},
            ratio=without / within,
        )


@cache
def _run(directory: Path | None) -> Run:
    """The run to look at; without one, a quick run that is made now."""
    if directory is not None:
        return read(directory)
    with TemporaryDirectory() as folder:
        return carry_out(Path(folder), "--scale", "quick")


def _name(run: Run, directory: Path | None) -> str:
    return f"{run.scale} run just made" if directory is None else f"{run.scale} run given"


def _seconds_to_load() -> float:
    """Python and all that a run imports, before its own clock begins to tick."""
    began = perf_counter()
    subprocess.run([sys.executable, "-c", "import orchestrator.reproduction"], check=True)
    return perf_counter() - began
