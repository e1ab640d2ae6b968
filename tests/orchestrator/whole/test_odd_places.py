"""Paths that nothing can be written to, or that cannot even be looked at: one line each."""

from pathlib import Path

import pytest

from orchestrator.cli import main
from tests.orchestrator.tiny import TINY, Place

NOWHERE = "/proc/none"  # where even root can make nothing
TOO_LONG = "a" * 300


def told(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str]:
    """How a command that fails exits, and what it says."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main([str(word) for word in words])
    assert isinstance(end.value.code, int)
    return end.value.code, capsys.readouterr().err


SWEEP = ["sweep", "maze-alpha-beta", "--scale", "smoke"]


@pytest.mark.parametrize(
    ("words", "option", "where"),
    [
        (["run", TINY], "--out", f"{NOWHERE}/x"),
        (["run", TINY], "--out", TOO_LONG),
        (["run", TINY], "--store", f"{NOWHERE}/x"),
        (["run", TINY], "--store", TOO_LONG),
        (SWEEP, "--out", f"{NOWHERE}/x"),
        (SWEEP, "--store", f"{NOWHERE}/x"),
    ],
)
def test_a_place_that_cannot_be_written_to(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    option: str,
    where: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, err = told(capsys, *words, option, where, "--executor", "serial")
    assert code == 3
    last = err.splitlines()[-1]
    assert last.startswith(f"error: cannot write {where}: ")
    assert "choose another place and run the same command again" in last


def test_results_that_cannot_be_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, finished: Place
) -> None:
    for words in (["run", TINY], ["report", finished.out]):
        code, err = told(capsys, *words, "--results", NOWHERE)
        assert code == 2
        assert err == f"error: {NOWHERE}: /proc is no folder that can be written to; name another\n"


@pytest.mark.parametrize(
    "words",
    [
        ["status", TOO_LONG],
        ["list", TOO_LONG],
        ["report", TOO_LONG],
        ["compare", TOO_LONG, TOO_LONG],
        ["plan", TOO_LONG],
        ["plan", TINY, "--store", TOO_LONG],
        ["sweep", TOO_LONG],
    ],
)
def test_a_name_that_is_too_long(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    code, err = told(capsys, *words)
    assert code in (2, 3)
    assert len(err.splitlines()) == 1
    assert err.startswith("error: ")
    assert err.endswith(": File name too long; name another\n")
