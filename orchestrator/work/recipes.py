"""Names for things by all that made them: recipes of artifacts, and the code that matters."""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from orchestrator.builders.registry import BUILDERS
from orchestrator.spec.structure import Plain

OUR_PACKAGE = "stitching"
DIGITS = 32  # of names
# Lists of parts: a part that is used is named by itself, and no other decides anything.
NOT_FOLLOWED = {"stitching.registry", "stitching.planning.registry", "stitching.methods.registry"}
CODE = (".py", ".so", ".pyd")
# Whose versions may change the bytes of any result.
NUMERIC_PACKAGES = ("gymnasium-robotics", "mujoco", "numpy", "robosuite", "scipy", "torch")


def canonical(plain: Any) -> str:
    """One text for equal values: sorted keys, no spaces, floats by their shortest form."""
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(plain: Any) -> str:
    """Stable name of a plain value: 32 hex digits."""
    return hashlib.sha256(canonical(plain).encode()).hexdigest()[:DIGITS]


def digests(plain: Plain, field: str, values: Iterable[str]) -> Iterator[str]:
    """Of each value the `digest` of `plain | {field: value}`; the rest is hashed but once.

    values: as `canonical` writes them.
    """
    gap = "\0"
    before, after = canonical(plain | {field: gap}).split(canonical(gap))
    begun = hashlib.sha256(before.encode())
    for value in values:
        whole = begun.copy()
        whole.update(f"{value}{after}".encode())
        yield whole.hexdigest()[:DIGITS]


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
    """Hash of the syntax trees of some modules and of every `stitching` module that they need.

    Modules named `beside` are added without what they import. Comments, docstrings and formatting
    do not matter; any other change does, and so do the versions of the numeric packages. So an edit
    to a planner retrains nothing, and an edit to IQL retrains exactly what IQL made.

    Of a module of another package all of that package counts, its compiled modules and its version
    included: what is needed of it is not for us to say.
    """
    names = [name for name in modules if _is_ours(name)]
    others = _Distribution.of(frozenset(set(modules) - set(names)))
    needed = _closure((*names, *others.asks_for))
    return digest(
        {
            "modules": {name: _code(name).syntax for name in sorted(needed | set(beside))},
            "packages": {name: importlib.metadata.version(name) for name in NUMERIC_PACKAGES},
            "other packages": others.content,
        }
    )


def _is_ours(module: str) -> bool:
    return module.partition(".")[0] == OUR_PACKAGE


@dataclass(frozen=True)
class _Distribution:
    """All that other packages bring with some of their modules."""

    content: Plain  # versions by distribution, hashes by file
    asks_for: tuple[str, ...]  # modules of this package that theirs import

    @classmethod
    def of(cls, modules: frozenset[str]) -> _Distribution:
        if not modules:
            return cls({}, ())
        brought_by = importlib.metadata.packages_distributions()
        packages = {module.partition(".")[0] for module in modules}
        names = {name for package in packages for name in brought_by.get(package, [])}
        packages |= {package for package, by in brought_by.items() if names & set(by)}
        content = {name: importlib.metadata.version(name) for name in sorted(names)}
        asks_for: set[str] = set()
        for name, file in sorted(found for package in packages for found in _files_of(package)):
            if file.suffix == ".py":
                code = _Code.of(file)
                content[name] = code.syntax
                asks_for |= code.imports
            else:
                content[name] = hashlib.sha256(file.read_bytes()).hexdigest()
        return cls(content, tuple(sorted(asks_for)))


def _files_of(package: str) -> Iterator[tuple[str, Path]]:
    """Python files and compiled modules of a top-level package or module, with their names."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        return
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    for folder in folders:
        for suffix in CODE:
            for file in folder.rglob(f"*{suffix}"):
                yield f"{package}/{file.relative_to(folder)}", file
    if not folders and spec.origin is not None:
        yield package, Path(spec.origin)


def _closure(modules: tuple[str, ...]) -> set[str]:
    seen: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in seen and name not in NOT_FOLLOWED:
            seen.add(name)
            waiting.extend(_code(name).imports)
    return seen


@dataclass(frozen=True)
class _Code:
    """What fingerprints ask of a module; many share one."""

    syntax: str  # hash of its syntax tree without docstrings
    imports: frozenset[str]  # modules of this package

    @classmethod
    def of(cls, file: Path) -> _Code:
        tree = ast.parse(file.read_bytes())
        return cls(_syntax(tree), frozenset(_named_imports(tree)))


@cache
def _code(module: str) -> _Code:
    file = _file_of(module)
    if file is None:
        raise ModuleNotFoundError(module)
    return _Code.of(file)


def _named_imports(tree: ast.Module) -> set[str]:
    """Modules of this package that are imported, in any form and anywhere in a module."""
    named: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            named |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None and not node.level:
            named |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in named if "." in name and _is_ours(name) and _file_of(name)}


@cache
def _file_of(module: str) -> Path | None:
    """The source of a module, without importing what is above it; None where there is none."""
    package = importlib.util.find_spec(module.partition(".")[0])
    if package is None or not package.submodule_search_locations:
        return None
    path = Path(package.submodule_search_locations[0]).joinpath(*module.split(".")[1:])
    candidates = (path / "__init__.py", path.with_name(f"{path.name}.py"))
    return next((file for file in candidates if file.is_file()), None)


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
