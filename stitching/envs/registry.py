"""The benchmarks by name."""

from __future__ import annotations

from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark

BENCHMARKS: dict[str, Benchmark] = {"maze": MAZE}

# The datasets that a benchmark's models learn from. Skills learn from "demonstrations" alone, the
# dynamics from the union.
DATASETS: dict[str, tuple[str, ...]] = {"maze": ("demonstrations", "exploration")}
