"""What skillstitch asks of a benchmark, and that its demonstrations are some."""

import pytest
from track import TRACK, TrackData, demonstrations

from stitching.data.transitions import check
from stitching.envs.protocol import Benchmark
from stitching.testing.benchmarks import BenchmarkConformance


class TestTrack(BenchmarkConformance):
    @pytest.fixture
    def benchmark(self) -> Benchmark:
        return TRACK


def test_every_drive_reaches_its_flag() -> None:
    data = demonstrations(TrackData(), seed=0)
    check(data, TRACK, "demonstrations")
    assert data.episode_successes.all()
