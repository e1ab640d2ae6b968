"""What the documentation shows is valid."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.benchmarks.check_data import check_data_lines
from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.cli import COMMANDS
from orchestrator.errors import BadDataError
from orchestrator.spec.spec import load_spec
from orchestrator.spec.tomls import Scale
from orchestrator.work.plan import make_plan

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("scale", ["smoke", "paper"])
def test_the_example_table_can_be_planned(tmp_path: Path, scale: Scale) -> None:
    text = (ROOT / "docs" / "extending.md").read_text()
    _, example = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    path = tmp_path / "my-table.toml"
    path.write_text(example)
    spec = load_spec(str(path), scale)
    assert make_plan(spec).nodes


def test_every_command_is_in_the_readme() -> None:
    text = (ROOT / "README.md").read_text()
    assert set(re.findall(r"^skillstitch ([\w-]+)", text, flags=re.MULTILINE)) == set(COMMANDS)


@pytest.mark.parametrize("document", [*sorted(ROOT.glob("docs/*.md")), ROOT / "README.md"])
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", document.read_text()):
        assert (document.parent / target).exists(), target


def test_the_example_package_is_as_the_text_shows_it() -> None:
    text, example = (ROOT / "docs" / "extending.md").read_text(), ROOT / "docs" / "example-package"
    entry_points, _ = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    assert entry_points in (example / "pyproject.toml").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    source = (example / "hold_stitch.py").read_text()
    for line in code.splitlines():
        assert "..." in line or line.split("  #")[0] in source


def write_own_data(script: int, demonstrator: Callable[..., np.ndarray]) -> None:
    """Run one of the page's scripts, for one episode; it writes to the working directory."""
    text = (ROOT / "docs" / "own-data.md").read_text()
    scripts = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    exec(scripts[script].replace("range(10)", "range(1)"), {"my_demonstrator": demonstrator})


def test_the_script_writes_labelled_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a demonstrator who always goes up."""
    monkeypatch.chdir(tmp_path)
    write_own_data(0, lambda observation, skill: np.eye(4, dtype=np.float32)[0])
    lines = list(check_data_lines("mine.npz", "maze"))
    assert lines[1] == "4 demonstrations of skills; 160 transitions in all"
    assert "no demonstration accomplishes g0, g1, g2, g3; these tasks ask for one of them:" in lines


def test_the_script_writes_recordings_of_the_kitchen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a demonstrator who stands still: they can be read, and nothing is to be learned."""
    monkeypatch.chdir(tmp_path)
    write_own_data(1, lambda seen: np.zeros(9))
    with pytest.raises(BadDataError, match=r"mine\.npz: no episode accomplishes a skill"):
        list(check_data_lines("mine.npz", "kitchen"))


def test_own_data_are_told_as_the_benchmarks_have_them() -> None:
    text = (ROOT / "docs" / "own-data.md").read_text()
    for name, one in BENCHMARKS.items():
        skills = ", ".join(f"`{skill.name}`" for skill in one.skills)
        row = f"| `{name}` | {one.observation_size} | {one.actions.size} | {skills} |"
        assert row in text
