"""Without the extra `run`: what reads runs works, and all else says what to install."""

import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

from tests.orchestrator.tiny import TINY, Place

ROOT = Path(__file__).parents[3]
MODULES = {
    "imageio-ffmpeg": "imageio_ffmpeg",
    "gymnasium-robotics": "gymnasium_robotics",
    "markdown-it-py": "markdown_it",
}


def extra() -> set[str]:
    """Top-level modules of what the extra brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = [Requirement(line).name for line in project["optional-dependencies"]["run"]]
    return {MODULES.get(name, name) for name in named}


def without(code: str) -> subprocess.CompletedProcess[str]:
    """Python in which nothing of the extra can be imported, as if it were not installed."""
    hidden = f"""
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {extra()!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Hidden())
"""
    command = [sys.executable, "-c", hidden + code]
    return subprocess.run(command, capture_output=True, text=True)


def command(*words: object) -> subprocess.CompletedProcess[str]:
    return without(f"from orchestrator.cli import main; main({list(map(str, words))!r})")


def test_the_extra_has_what_trains_and_simulates() -> None:
    assert {"torch", "ray", "mujoco", "robosuite", "optuna", "mlflow"} <= extra()


def test_a_run_is_read_as_tables(finished: Place) -> None:
    read = without(
        "from analysis import open_run\n"
        f"run = open_run({str(finished.out)!r})\n"
        "print(len(run.episodes), sorted(set(run.episodes['method'])))"
    )
    assert read.returncode == 0, read.stderr
    assert "mb-stitch" in read.stdout


def test_commands_that_read_runs(done: Place) -> None:
    for words in (
        ("list", done.root),
        ("status", done.out),
        ("report", done.out),
        ("compare", done.out, done.out),
    ):
        answer = command(*words)
        assert answer.returncode == 0, answer.stderr
        assert answer.stdout


def test_others_say_what_to_install(done: Place) -> None:
    for words in (("plan", TINY), ("run", TINY, "--out", done.root / "new"), ("enjoy", done.out)):
        answer = command(*words)
        assert answer.returncode == 2, answer.stderr
        assert "pip install -e '.[run]'" in answer.stderr
        assert "Traceback" not in answer.stderr
    assert not (done.root / "new").exists()
