"""The benchmarks by name."""

from __future__ import annotations

from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark
from stitching.envs.robosuite.can import CAN
from stitching.envs.robosuite.door import DOOR

BENCHMARKS: dict[str, Benchmark] = {
    benchmark.name: benchmark for benchmark in (MAZE, KITCHEN, DOOR, CAN)
}
