"""Where a result comes from: complete, and without a word about this machine's paths."""

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.storage import provenance as module
from orchestrator.storage.provenance import git_revision, matters, provenance
from orchestrator.work.plan import make_plan
from tests.orchestrator.tiny import tiny_spec


def test_everything_a_reviewer_asks_for() -> None:
    record = provenance()
    assert {"written", "versions", "git_revision", "cpu", "cores", "system"} <= record.keys()
    assert {"python", "torch", "numpy", "mujoco", "ray", "mlflow"} <= record["versions"].keys()
    assert str(Path.cwd()) not in json.dumps(record)


def test_what_matters_names_code_and_packages() -> None:
    plan = make_plan(replace(tiny_spec(), methods=("no-stitch", "mb-stitch")))
    named = matters([plan])
    assert {name.removeprefix("code that ") for name in named if name.startswith("code")} == {
        "makes agent", "makes dynamics", "makes maze-demonstrations", "makes maze-exploration",
        "plays shared first skills", "plays No-Stitch", "plays MB-Stitch",
    }  # fmt: skip
    assert {"numpy", "torch", "robosuite"} <= matters([]).keys()


def test_the_revision_is_marked_when_sources_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "orchestrator" / "storage" / "provenance.py"
    source.parent.mkdir(parents=True)
    source.write_text("x = 1\n")
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "first"]):
        subprocess.run([*git, *command], cwd=tmp_path, check=True)
    monkeypatch.setattr(module, "__file__", str(source))
    clean = git_revision()
    assert len(clean) == 12
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "scores.csv").write_text("1\n")
    assert git_revision() == clean
    source.write_text("x = 2\n")
    assert git_revision() == f"{clean}-dirty"


def test_no_repository_no_revision(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        module, "__file__", str(tmp_path / "orchestrator" / "storage" / "provenance.py")
    )
    assert git_revision() == "unknown"
