"""The benchmarks by name: those of this package, and those of installed packages."""

from __future__ import annotations

from orchestrator.benchmarks.kit import Kit
from orchestrator.benchmarks.kitchen import KITCHEN_KIT
from orchestrator.benchmarks.maze import MAZE_KIT
from orchestrator.benchmarks.robosuite import CAN_KIT, DOOR_KIT
from stitching.envs.protocol import Benchmark
from stitching.registry import PartError, with_installed

KITS: dict[str, Kit] = with_installed(
    "skillstitch.benchmarks",
    {kit.benchmark.name: kit for kit in (MAZE_KIT, KITCHEN_KIT, DOOR_KIT, CAN_KIT)},
    lambda part: "" if isinstance(part, Kit) else "is no Kit",
)

for _name, _kit in KITS.items():
    if _kit.benchmark.name != _name:
        raise PartError(f"the benchmark {_kit.benchmark.name!r} is registered as {_name!r}")

BENCHMARKS: dict[str, Benchmark] = {name: kit.benchmark for name, kit in KITS.items()}
