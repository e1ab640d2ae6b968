"""Names for things by all that made them: recipes of artifacts, and the code that matters."""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import json
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from orchestrator.builders import BUILDERS
from orchestrator.structure import Plain

NUMERIC_PACKAGES = ("numpy", "torch")  # whose versions may change the bytes of any result


def canonical(plain: Any) -> str:
    """One text for equal values: sorted keys, no spaces, floats by their shortest form."""
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(plain: Any) -> str:
    """Stable name of a plain value: 32 hex digits."""
    return hashlib.sha256(canonical(plain).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Recipe:
    """How one artifact is made; its key is the hash of everything written here."""

    kind: str
    params: Plain
    inputs: dict[str, str] = field(default_factory=dict)  # role → key of another recipe

    @property
    def key(self) -> str:
        return digest(
            {
                "kind": self.kind,
                "params": self.params,
                "inputs": self.inputs,
                "code": code_fingerprint(BUILDERS[self.kind].code),
            }
        )


@cache
def code_fingerprint(module: str) -> str:
    """Hash of a module's syntax tree, those of the `stitching` modules it needs, and packages.

    Comments, docstrings and formatting do not matter; any other change does. So an edit to a
    planner retrains nothing, and an edit to IQL retrains exactly what IQL made.
    """
    trees = {name: _syntax(name) for name in sorted(_closure(module))}
    packages = {name: importlib.metadata.version(name) for name in NUMERIC_PACKAGES}
    return digest({"modules": trees, "packages": packages})


def _closure(module: str) -> set[str]:
    seen: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting.extend(_imports(name))
    return seen


@cache
def _tree(module: str) -> ast.Module:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    return ast.parse(Path(spec.origin).read_text())


def _imports(module: str) -> list[str]:
    sources = [n.module or "" for n in ast.walk(_tree(module)) if isinstance(n, ast.ImportFrom)]
    return [source for source in sources if source.startswith("stitching.")]


def _syntax(module: str) -> str:
    tree = ast.parse(ast.unparse(_tree(module)))  # a copy, so that the cached tree stays whole
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_docstring(body[0]):
            body[0] = ast.Pass()
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _is_docstring(node: Any) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
