"""The rules of the house: which package may import what, how long files and folders may grow.

stitching ← orchestrator ← sweeps;  analysis stands alone;  the command line sees everything
"""

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("stitching", "orchestrator", "sweeps", "analysis")
MOST_LINES = 300
MAY_BE_LONGER: set[str] = set()

SOURCES = {
    str(path.relative_to(ROOT)): path.read_text()
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


def imported(tree: ast.AST, file: str) -> Iterator[tuple[str, ast.AST]]:
    """Every module named by an import, absolute, and by `import_module` or `__import__`."""
    package = Path(file).parent.parts
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield f"{base}.{alias.name}", node
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            function = node.func.attr if isinstance(node.func, ast.Attribute) else node.func
            name = function.id if isinstance(function, ast.Name) else function
            if name in ("import_module", "__import__") and isinstance(node.args[0].value, str):
                yield node.args[0].value, node


@cache
def names_in(source: str, file: str) -> set[str]:
    return {name for name, _ in imported(ast.parse(source), file)}


def importers_of(module: str, within: str = "") -> set[str]:
    """Files below `within` that import the module or anything in it."""
    return {
        file
        for file, source in SOURCES.items()
        if file.startswith(within)
        and any(f"{name}.".startswith(f"{module}.") for name in names_in(source, file))
    }


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("import ray.util", "ray.util"),
        ("import numpy, ray as r", "ray"),
        ("from ray import get", "ray.get"),
        ("from ray.util import queue", "ray.util.queue"),
        ("from . import spec", "orchestrator.executors.spec"),
        ("from ..spec import Spec", "orchestrator.spec.Spec"),
        ("def f():\n    if x:\n        import ray", "ray"),
        ("importlib.import_module('ray')", "ray"),
        ("__import__('ray')", "ray"),
    ],
)
def test_the_reader_of_imports_finds(line: str, name: str) -> None:
    assert name in names_in(line, "orchestrator/executors/serial.py")


def test_no_folder_has_more_than_fourteen_modules() -> None:
    """What is to be found in a folder should be seen at a glance; tests mirror the sources."""
    folders = (*PACKAGES, "tests", "docs")
    files = [file for folder in folders for file in (ROOT / folder).rglob("*.py")]
    counts = Counter(file.parent.relative_to(ROOT) for file in files if file.name != "__init__.py")
    assert not {str(folder): count for folder, count in counts.items() if count > 14}


def test_the_sources_are_found() -> None:
    for file in ("stitching/rollout.py", "orchestrator/cli.py", "analysis/report.py"):
        assert file in SOURCES
    assert importers_of("torch") >= {"stitching/rollout.py", "stitching/models/iql.py"}


@pytest.mark.parametrize(
    "module", ["ray", "optuna", "mlflow", "orchestrator", "sweeps", "analysis"]
)
def test_the_method_knows_nothing_of_what_runs_it(module: str) -> None:
    assert importers_of(module, within="stitching/") == set()


@pytest.mark.parametrize(
    "module",
    ["ray", "torch", "mujoco", "optuna", "mlflow", "stitching", "orchestrator", "sweeps"],
)
def test_analysis_stands_alone(module: str) -> None:
    """But for the one file that draws recorded states, in a process of its own."""
    allowed = {"analysis/render.py"} if module == "mujoco" else set()
    assert importers_of(module, within="analysis/") == allowed


def test_pictures_are_rendered_in_a_process_of_their_own() -> None:
    assert importers_of("analysis.render") == set()


def test_sweeps_are_known_to_the_command_line_alone() -> None:
    outside = {file for file in importers_of("sweeps") if not file.startswith("sweeps/")}
    commands = ("cli", "spec_commands", "run_commands")
    assert outside <= {f"orchestrator/{name}.py" for name in commands}


def test_ray_lives_in_its_executor() -> None:
    assert importers_of("ray") == {"orchestrator/executors/ray.py"}


def test_mlflow_lives_in_tracking() -> None:
    files = importers_of("mlflow")
    assert files
    assert all(file.startswith("orchestrator/tracking/") for file in files)


@pytest.mark.parametrize("file", sorted(importers_of("mlflow")))
def test_mlflow_is_loaded_when_it_is_used(file: str) -> None:
    """It takes seconds to import, and none of the science needs it."""
    at_import = [
        node
        for statement in ast.parse(SOURCES[file]).body
        if not isinstance(statement, ast.FunctionDef | ast.ClassDef)
        and not (isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING")
        for node in ast.walk(statement)
    ]
    top_level = {name for node in at_import for name, _ in imported(node, file)}
    assert not any(f"{name}.".startswith("mlflow.") for name in top_level)


def test_optuna_lives_in_sweeps() -> None:
    assert all(file.startswith("sweeps/") for file in importers_of("optuna"))


def loaded_by(statement: str) -> set[str]:
    """Top-level modules in memory after the statement, in a process of its own."""
    code = f"import sys\n{statement}\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(run.stdout.split())


def test_a_report_is_written_without_the_heavy_packages() -> None:
    """Not by way of anything else either."""
    loaded = loaded_by("import analysis.report")
    assert {"analysis", "pandas"} <= loaded
    heavy = {"torch", "ray", "mujoco", "mlflow", "optuna", "robosuite", "gymnasium_robotics"}
    assert not loaded & (heavy | {"stitching", "orchestrator", "sweeps"})


def test_the_method_plays_without_what_runs_it() -> None:
    modules = [
        file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        for file in SOURCES
        if file.startswith("stitching/")
    ]
    loaded = loaded_by(f"import {', '.join(modules)}")
    assert {"stitching", "torch"} <= loaded
    assert not loaded & {"ray", "mlflow", "optuna", "orchestrator", "sweeps", "analysis", "pandas"}


def opened_in_the_locale(source: str) -> Iterator[str]:
    """Calls that read or write text in whatever encoding the machine is set to."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call) or any(word.arg == "encoding" for word in node.keywords):
            continue
        method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        function = node.func.id if isinstance(node.func, ast.Name) else ""
        constants = [argument for argument in node.args if isinstance(argument, ast.Constant)]
        strings = [each.value for each in constants if isinstance(each.value, str)]
        if (
            (method == "read_text" and not node.args)
            or method == "write_text"
            or (method == "open" and strings and "b" not in strings[0])
            or (function == "open" and not any("b" in mode for mode in strings))
        ):
            yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize(
    "line",
    [
        "path.read_text()",
        "path.write_text(text)",
        "path.open('w')",
        "open(path)",
        "open(path, 'a')",
    ],
)
def test_the_reader_of_encodings_finds(line: str) -> None:
    assert list(opened_in_the_locale(line))
    assert not list(opened_in_the_locale(f"{line[:-1]}, encoding='utf-8')".replace("(,", "(")))


@pytest.mark.parametrize("file", SOURCES)
def test_files_are_read_and_written_as_utf_8(file: str) -> None:
    """Here and there the locale says otherwise."""
    assert list(opened_in_the_locale(SOURCES[file])) == []


@pytest.mark.parametrize("file", SOURCES)
def test_files_stay_short_enough_to_read(file: str) -> None:
    lines = len(SOURCES[file].splitlines())
    assert (lines <= MOST_LINES) != (file in MAY_BE_LONGER)
