"""Every registered benchmark does what a benchmark must."""

import pytest

from orchestrator.benchmarks.registry import BENCHMARKS
from stitching.envs.protocol import Benchmark
from stitching.testing.benchmarks import BenchmarkConformance


@pytest.mark.parametrize("benchmark", BENCHMARKS.values(), ids=list(BENCHMARKS))
class TestBenchmarks(BenchmarkConformance):
    def test_is_registered_under_its_own_name(self, benchmark: Benchmark) -> None:
        assert BENCHMARKS[benchmark.name] is benchmark
