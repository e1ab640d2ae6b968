"""`skillstitch check-data`: what own data hold, and what is wrong with them."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from stitching.envs.kitchen import KITCHEN
from tests.orchestrator.benchmarks.written import idle, maze_demonstrations, write_maze
from tests.orchestrator.test_cli import SLOW, loaded

Check = Callable[[object, str], tuple[int, str]]


@pytest.fixture
def check(capsys: pytest.CaptureFixture[str]) -> Check:
    """Exit code, and what is said."""

    def check(file: object, benchmark: str) -> tuple[int, str]:
        capsys.readouterr()
        code = 0
        try:
            main(["check-data", str(file), "--benchmark", benchmark])
        except SystemExit as end:
            code = int(end.code or 0)
        said = capsys.readouterr()
        return code, said.out + said.err

    return check


def test_what_they_hold_is_said_skill_by_skill(check: Check, tmp_path: Path) -> None:
    code, said = check(write_maze(tmp_path / "mine.npz", without="g2"), "maze")
    assert code == 0
    data = maze_demonstrations()
    assert f"40 demonstrations of skills; {len(data)} transitions in all" in said
    lengths = np.diff(data.episode_ends, prepend=0)[:10]
    words = [line.split() for line in said.splitlines()]
    spread = [f"{each:.0f}" for each in (lengths.min(), np.median(lengths), lengths.max())]
    assert ["g0", "10", "10", *spread] in words
    assert any(line[:3] == ["g2", "10", "0"] for line in words)
    assert "no demonstration accomplishes g2; these tasks ask for one of them:" in said
    assert "  table1: 48 of 60" in said
    assert "far from" not in said


def test_all_that_is_accomplished(check: Check, tmp_path: Path) -> None:
    code, said = check(write_maze(tmp_path / "mine.npz"), "maze")
    assert code == 0
    assert said.endswith("every skill is accomplished by some demonstration\n")


def test_other_units_are_seen_at_the_start(check: Check, tmp_path: Path) -> None:
    """As where somebody writes degrees."""
    shown = idle(KITCHEN)
    shown["observations"][:, 0] = np.linspace(80.0, 90.0, len(shown["observations"]))
    np.savez(tmp_path / "mine.npz", **shown)
    code, said = check(tmp_path / "mine.npz", "kitchen")
    assert code == 0
    assert "far from the benchmark's start in all of the data: numbers 0" in said


def test_recordings_of_the_kitchen_need_no_labels(check: Check, tmp_path: Path) -> None:
    """A microwave door that is open in the last state."""
    seen = np.zeros((4, 59))
    seen[:, 32:39] = [-0.27, 0.35, 1.62, 1.0, 0.0, 0.0, 0.0]
    seen[3, 31] = -0.6
    arrays = {"actions": np.zeros((3, 9)), "episode_ends": np.array([3])}
    np.savez(tmp_path / "mine.npz", observations=seen, **arrays)
    code, said = check(tmp_path / "mine.npz", "kitchen")
    assert code == 0
    assert ["microwave", "1", "1", "3", "3", "3"] in [line.split() for line in said.splitlines()]
    np.savez(tmp_path / "mine.npz", observations=np.zeros((4, 59)), **arrays)
    code, said = check(tmp_path / "mine.npz", "kitchen")
    assert code == 7
    assert "mine.npz: no episode accomplishes a skill" in said


@pytest.mark.parametrize(
    ("benchmark", "code", "told"),
    [
        ("kitchen", 7, "observations is float32 of shape .* expected observations of floats"),
        ("mze", 2, "no benchmark 'mze' that takes own data: maze, kitchen, robosuite-door"),
    ],
)
def test_what_does_not_fit(
    benchmark: str, code: int, told: str, check: Check, tmp_path: Path
) -> None:
    ended, said = check(write_maze(tmp_path / "mine.npz"), benchmark)
    assert ended == code
    assert len(said.splitlines()) == 1
    assert re.search(told, said)


def test_a_maze_without_labels_is_7(check: Check, tmp_path: Path) -> None:
    file = write_maze(tmp_path / "mine.npz")
    with np.load(file) as whole:
        np.savez(file, **{name: whole[name] for name in whole.files if name != "skills"})
    code, said = check(file, "maze")
    assert (code, len(said.splitlines())) == (7, 1)
    assert "episode 0: no skill is said; expected one of g0, g1, g2, g3" in said


def test_a_file_that_is_not_there_is_2(check: Check, tmp_path: Path) -> None:
    code, said = check(tmp_path / "gone.npz", "maze")
    assert (code, said) == (2, f"error: data.file: no file {tmp_path / 'gone.npz'}\n")


def test_nothing_slow_is_imported(tmp_path: Path) -> None:
    file = write_maze(tmp_path / "mine.npz")
    assert not loaded("check-data", file, "--benchmark", "maze") & SLOW
