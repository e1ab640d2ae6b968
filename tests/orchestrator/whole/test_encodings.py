"""Terminals and logs that cannot show every character; files that say in which order bytes come."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.spec.spec import load_spec
from tests.orchestrator.tiny import TINY, Place

PLAIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def command(environment: dict[str, str], *words: object) -> subprocess.CompletedProcess[bytes]:
    line = [sys.executable, "-m", "orchestrator.cli", *map(str, words)]
    return subprocess.run(line, env=os.environ | environment, capture_output=True)


@pytest.mark.parametrize("environment", [PLAIN, {"PYTHONIOENCODING": "ascii"}])
def test_what_cannot_be_shown_is_written_as_its_code(
    finished: Place, environment: dict[str, str]
) -> None:
    for words in (["plan", TINY], ["compare", finished.out, finished.out], ["run", TINY, "--help"]):
        answer = command(environment, *words)
        assert (answer.returncode, answer.stderr) == (0, b"")
        assert answer.stdout.isascii()


def test_a_run_is_finished_and_read_in_a_plain_locale(done: Place) -> None:
    paths = ["--out", done.out, "--store", done.store_root, "--tracking-uri", "none"]
    answer = command(PLAIN, "run", TINY, *paths)
    assert answer.returncode == 0, answer.stderr.decode()
    assert command(PLAIN, "report", done.out).returncode == 0


def test_a_path_of_odd_bytes_can_be_named() -> None:
    answer = command({}, "status", os.fsdecode(b"r\xff"))
    assert answer.returncode == 2
    assert answer.stderr == b"error: r\\udcff is no run directory: it has no spec.json\n"


def test_a_spec_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TINY.read_bytes())
    assert load_spec(str(path)) == load_spec(str(TINY))
