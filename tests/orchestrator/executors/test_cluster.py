"""A cluster loses a node in the middle of a run; its tables do not change."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.ledger import Ledger
from orchestrator.spec import load_spec
from tests.orchestrator.executors import two_nodes
from tests.orchestrator.tiny import Place, promised_bytes

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
    assert process.stdin is not None
    process.stdin.close()
    process.wait(60)


def blocks(out: Path) -> int:
    if not (out / "ledger.sqlite").is_file():
        return 0
    ledger = Ledger(out / "ledger.sqlite", read_only=True)
    try:
        return len(ledger.finished())
    finally:
        ledger.close()


def test_a_node_is_removed_without_grace(cluster: subprocess.Popen[str], tmp_path: Path) -> None:
    assert cluster.stdout is not None
    assert cluster.stdin is not None
    address = cluster.stdout.readline().strip()
    place = Place(tmp_path / "cluster")
    words = ["run", "table1", "--scale", "smoke", "--address", address, "--tracking-uri", "none"]
    paths = ["--out", str(place.out), "--store", str(place.store_root)]
    run = subprocess.Popen([sys.executable, "-m", "orchestrator.cli", *words, *paths])

    expected = Place(tmp_path / "serial")
    while run.poll() is None and not blocks(place.out):
        time.sleep(0.02)
    before = blocks(place.out)
    print("removed", file=cluster.stdin, flush=True)
    assert cluster.stdout.readline() == "removed\n"
    expected.carry_out(load_spec("table1", "smoke"))
    assert run.wait(180) == 0
    assert 0 < before < blocks(place.out)
    assert promised_bytes(place.out) == promised_bytes(expected.out)
