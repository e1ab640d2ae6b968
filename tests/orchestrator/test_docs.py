"""What the documentation shows is valid."""

import re
from pathlib import Path

import pytest

from orchestrator.cli import COMMANDS
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
    assert set(re.findall(r"^skillstitch (\w+)", text, flags=re.MULTILINE)) == set(COMMANDS)


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
