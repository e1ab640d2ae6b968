"""The package of docs/extending.md: installed, tested, played and named as any other part."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest

from orchestrator.spec.spec import load_spec
from orchestrator.storage.claim import describe
from orchestrator.work.plan import make_plan

EXAMPLE = Path(__file__).parents[3] / "docs" / "example-package"
METHODS = ("no-stitch", "hold-stitch", "mb-stitch", "mb-stitch[planner=hold-shooting]")
RUN = (
    "run", "track.toml", "--scale", "smoke", "--out", "run", "--store", "store",
    "--tracking-uri", "none", "--workers", "1",
)  # fmt: skip
NAMES = f"""
import json
from dataclasses import replace
from orchestrator.work.plan import make_plan
from orchestrator.spec.spec import load_spec
spec = load_spec("table1", "smoke")
plan = make_plan(replace(spec, methods={METHODS}))
names = {{node.method: task.key for (node, _), task in plan.tasks.items()}}
print(json.dumps(names | {{"recipes": sorted(plan.recipes)}}))
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example's files and, in "site", the package as pip installs it."""
    folder = tmp_path_factory.mktemp("example")
    copy = shutil.copytree(EXAMPLE, folder / "source")
    shutil.copy(EXAMPLE / "track.toml", folder)
    install = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--target"]
    run(folder, "-m", "pip", *install, str(folder / "site"), str(copy))
    return folder


def called(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Python with the package."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder / "site"), *sys.path])}
    return subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True
    )


def run(folder: Path, *command: str) -> str:
    """What it prints."""
    done = called(folder, *command)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@contextmanager
def edited(folder: Path, module: str, old: str, new: str) -> Iterator[None]:
    file = folder / "site" / module
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    try:
        yield
    finally:
        file.write_text(text)


@pytest.mark.slow
@pytest.mark.ray
def test_a_table_of_its_own_parts_is_played_through_ray(place: Path) -> None:
    run(place, "-m", "orchestrator.cli", *RUN)
    episodes = pd.read_parquet(place / "run" / "episodes.parquet")
    assert set(episodes["method"]) == set(METHODS)
    assert set(episodes["task"]) >= {"left>middle", "right>left"}
    segments = pd.read_parquet(place / "run" / "segments.parquet")
    assert segments["stitch_steps"][segments["method"] == "hold-stitch"].max() >= 3
    table = (place / "run" / "report" / "track.md").read_text()
    assert "Hold-Stitch" in table
    assert "planner=hold-shooting" in table
    with edited(place, "hold_stitch.py", "axis=1", "axis=-2"):
        refused = called(place, "-m", "orchestrator.cli", *RUN)
    assert refused.returncode == 5
    assert "code that plays Hold-Stitch: " in refused.stderr
    assert "code that plays shared first skills" not in refused.stderr


def test_its_own_tests_pass(place: Path) -> None:
    run(place, "-m", "pytest", "-q", "-p", "no:cacheprovider", "source")


def test_an_edit_names_what_the_package_plays_anew_and_nothing_else(place: Path) -> None:
    before = json.loads(run(place, "-c", NAMES))
    with edited(place, "hold_shooting.py", "argmax", "argmin"):
        after = json.loads(run(place, "-c", NAMES))
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"hold-stitch", "mb-stitch[planner=hold-shooting]"}


def test_what_is_not_used_leaves_no_trace(place: Path) -> None:
    """Neither in names nor in what a run directory keeps: it is read without the package."""
    code = """
import json
from orchestrator.work.plan import make_plan
from orchestrator.storage.claim import describe
from orchestrator.spec.spec import load_spec
spec = load_spec("table1", "smoke")
plan = make_plan(spec)
keys = [task.key for task in plan.tasks.values()]
print(json.dumps([describe(spec), sorted(plan.recipes), keys]))
"""
    with_package = json.loads(run(place, "-c", code))
    spec = load_spec("table1", "smoke")
    plan = make_plan(spec)
    here = [describe(spec), sorted(plan.recipes), [task.key for task in plan.tasks.values()]]
    assert with_package == json.loads(json.dumps(here))


def test_a_package_that_cannot_be_used_is_named(place: Path) -> None:
    with edited(
        place,
        "hold_stitch.py",
        "import annotations\n",
        "import annotations\nimport nothing_so_called\n",
    ):
        failed = called(place, "-m", "orchestrator.cli", "plan", "table1", "--scale", "smoke")
    assert failed.returncode == 2
    assert len(failed.stderr.splitlines()) == 1
    assert "error: skillstitch-example, entry point 'hold-s" in failed.stderr
    assert "No module named 'nothing_so_called'; mend or uninstall it" in failed.stderr
