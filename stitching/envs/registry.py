"""The benchmarks by name."""

from __future__ import annotations

from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark

BENCHMARKS: dict[str, Benchmark] = {"maze": MAZE, "kitchen": KITCHEN}
