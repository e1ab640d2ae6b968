"""A cluster loses a node in the middle of a run; its tables do not change."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.spec.spec import load_spec
from tests.orchestrator.executors import two_nodes
from tests.orchestrator.tiny import Place, blocks_played, promised_bytes

pytestmark = [pytest.mark.ray, pytest.mark.slow, pytest.mark.timeout(240)]


@pytest.fixture
def cluster() -> Iterator[subprocess.Popen[str]]:
    """Its first line is its address; see `two_nodes`."""
    process = subprocess.Popen(
        [sys.executable, two_nodes.__file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"RAY_USAGE_STATS_ENABLED": "0"},
    )
    yield process
    process.communicate(timeout=60)  # whose end of input ends the cluster


def test_a_node_is_removed_without_grace(cluster: subprocess.Popen[str], tmp_path: Path) -> None:
    """Smoke Table 1, with models good enough and blocks small enough to last for a while."""
    smoke = load_spec("table1", "smoke")
    spec = replace(
        smoke, episodes=24, block_episodes=4, agent=replace(smoke.agent, learning_rate=3e-3)
    )
    options = ["--episodes", "24", "--block-episodes", "4", "--agent.learning-rate", "3e-3"]
    expected, place = Place(tmp_path / "serial"), Place(tmp_path / "cluster")
    expected.carry_out(spec)

    assert cluster.stdout is not None
    assert cluster.stdin is not None
    address = cluster.stdout.readline().strip()
    words = ["run", "table1", "--scale", "smoke", *options, "--address", address]
    paths = ["--out", str(place.out), "--store", str(place.store_root), "--tracking-uri", "none"]
    run = subprocess.Popen([sys.executable, "-m", "orchestrator.cli", *words, *paths])
    all_blocks = blocks_played(expected.out)
    while run.poll() is None and blocks_played(place.out) < all_blocks // 4:
        time.sleep(0.02)
    print("remove it", file=cluster.stdin, flush=True)
    assert cluster.stdout.readline() == "removed\n"
    assert blocks_played(place.out) < all_blocks
    assert run.wait(120) == 0
    assert promised_bytes(place.out) == promised_bytes(expected.out)
