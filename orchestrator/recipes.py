"""Names for things by all that made them: recipes of artifacts, and the code that matters."""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from orchestrator.builders.registry import BUILDERS
from orchestrator.structure import Plain

METHOD_PACKAGE = "stitching"
# Whose versions may change the bytes of any result.
NUMERIC_PACKAGES = ("gymnasium-robotics", "mujoco", "numpy", "robosuite", "scipy", "torch")


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
        builder = BUILDERS[self.kind]
        return digest(
            {
                "kind": self.kind,
                "params": self.params,
                "inputs": self.inputs,
                "code": code_fingerprint(builder.code, builder.setup),
            }
        )


@cache
def code_fingerprint(modules: tuple[str, ...], beside: tuple[str, ...] = ()) -> str:
    """Hash of the syntax trees of some modules and of what they need of `stitching`.

    Where a module is another package's, of what they need of that, too. Modules named `beside` are
    added without what they import. Comments, docstrings and formatting do not matter; any other
    change does, and so do the versions of the numeric packages and of packages that bring modules.
    So an edit to a planner retrains nothing, and an edit to IQL retrains exactly what IQL made.
    """
    trees = {name: _syntax(_tree(name)) for name in sorted(_closure(modules) | set(beside))}
    versions = {name: importlib.metadata.version(name) for name in NUMERIC_PACKAGES}
    return digest({"modules": trees, "packages": versions | _versions(_packages(modules))})


def _packages(modules: Iterable[str]) -> set[str]:
    """The top-level packages that bring some modules."""
    return {module.partition(".")[0] for module in modules}


def _versions(packages: set[str]) -> dict[str, str]:
    """Versions of the distributions of packages that are not ours."""
    others = packages - {METHOD_PACKAGE}
    if not others:
        return {}
    brought_by = importlib.metadata.packages_distributions()
    names = {name for package in others for name in brought_by.get(package, [])}
    return {name: importlib.metadata.version(name) for name in sorted(names)}


def _closure(modules: tuple[str, ...]) -> set[str]:
    packages = frozenset({METHOD_PACKAGE} | _packages(modules))
    seen: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting.extend(_imports(name, packages))
    return seen


@cache
def _tree(module: str) -> ast.Module:
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(module)
    return ast.parse(Path(spec.origin).read_text())


def _imports(module: str, packages: frozenset[str]) -> set[str]:
    """Modules of the packages that a module imports, in any form and anywhere in it."""
    named: set[str] = set()
    for node in ast.walk(_tree(module)):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            named |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    own = {name for name in named if "." in name and name.partition(".")[0] in packages}
    return {name for name in own if _is_module(name)}


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:  # its parent is a module, and no package
        return False


def _syntax(tree: ast.Module) -> str:
    """Hash of a syntax tree without its docstrings."""
    tree = ast.parse(ast.unparse(tree))  # a copy: the given one stays whole
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and _is_docstring(body[0]):
            body[:1] = [] if len(body) > 1 or isinstance(node, ast.Module) else [ast.Pass()]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _is_docstring(node: Any) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
