"""The site of the documentation leaves no page out, and its API reference names what there is."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
DIRECTIVE = re.compile(r"^::: (\S+)(?:\n    options:\n      members: \[(.*)\])?", re.MULTILINE)


def pages_of(nav: Any) -> Iterator[str]:
    """The files that a navigation leads to, at any depth."""
    if isinstance(nav, str):
        yield nav
    else:
        for entry in nav.values() if isinstance(nav, dict) else nav:
            yield from pages_of(entry)


def documented() -> Iterator[str]:
    """All that the API reference names: modules, what is in them, and chosen members."""
    for page in DOCS.glob("api/*.md"):
        for name, members in DIRECTIVE.findall(page.read_text()):
            yield name
            yield from (f"{name}.{member}" for member in re.findall(r"\w+", members))


def defined_in(file: Path) -> set[str]:
    """Names of the functions and classes of a module, read and not imported: that takes long."""
    body = ast.parse(file.read_text()).body
    return {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def test_every_page_is_in_the_navigation_once() -> None:
    led_to = list(pages_of(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    assert len(led_to) == len(set(led_to))
    assert {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")} <= set(led_to)


@pytest.mark.parametrize("name", sorted(documented()))
def test_the_api_reference_names_what_there_is(name: str) -> None:
    whole, (folder, _, last) = ROOT / name.replace(".", "/"), name.rpartition(".")
    if whole.with_suffix(".py").is_file() or (whole / "__init__.py").is_file():
        return
    module = ROOT / folder.replace(".", "/")
    file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
    assert last in defined_in(file)
