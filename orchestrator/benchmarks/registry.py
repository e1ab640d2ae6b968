"""The benchmarks by name: those of this package, and those of installed packages."""

from __future__ import annotations

from orchestrator.benchmarks.entry import BenchmarkEntry
from orchestrator.benchmarks.kitchen import KITCHEN_ENTRY
from orchestrator.benchmarks.maze import MAZE_ENTRY
from orchestrator.benchmarks.robosuite import CAN_ENTRY, DOOR_ENTRY
from stitching.envs.protocol import Benchmark
from stitching.registry import PartError, with_installed

ENTRIES: dict[str, BenchmarkEntry] = with_installed(
    "skillstitch.benchmarks",
    {entry.benchmark.name: entry for entry in (MAZE_ENTRY, KITCHEN_ENTRY, DOOR_ENTRY, CAN_ENTRY)},
    lambda part: "" if isinstance(part, BenchmarkEntry) else "is no BenchmarkEntry",
)

for _name, _entry in ENTRIES.items():
    if _entry.benchmark.name != _name:
        raise PartError(f"the benchmark {_entry.benchmark.name!r} is registered as {_name!r}")

BENCHMARKS: dict[str, Benchmark] = {name: entry.benchmark for name, entry in ENTRIES.items()}
