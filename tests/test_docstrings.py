"""Public functions and classes say what they are for."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("package", ["stitching", "orchestrator", "sweeps", "analysis"])
def test_nearly_all_have_a_docstring(package: str) -> None:
    public = [
        (f"{path.relative_to(ROOT)}: {node.name}", ast.get_docstring(node))
        for path in sorted((ROOT / package).rglob("*.py"))
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    ]
    silent = [name for name, text in public if not text]
    assert len(silent) <= 0.02 * len(public), silent
