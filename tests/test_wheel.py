"""The wheel works away from the checkout: with its specs, its paper's numbers and its page."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("stitching", "orchestrator", "sweeps", "analysis")


def run(*command: object, folder: Path, site: Path | None = None) -> str:
    """Python in `folder`, with what is installed in `site` before all else; what it prints."""
    path = {"PYTHONPATH": str(site)} if site else {}
    done = subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=folder, env=os.environ | path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_table_is_reproduced_from_the_wheel(tmp_path: Path) -> None:
    own = ["--no-deps", "--no-build-isolation", "--quiet"]
    source = tmp_path / "source"  # building leaves files behind
    source.mkdir()
    for name in (*PACKAGES, "pyproject.toml", "README.md"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, source / name)
    run("-m", "pip", "wheel", *own, "--wheel-dir", tmp_path / "wheels", source, folder=tmp_path)
    (wheel,) = (tmp_path / "wheels").glob("skillstitch-*.whl")
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    run("-m", "pip", "install", *own, "--target", site, wheel, folder=tmp_path)

    def asked(*words: object) -> str:
        return run("-m", "orchestrator.cli", *words, folder=empty, site=site)

    where = run("-c", "import orchestrator; print(orchestrator.__file__)", folder=empty, site=site)
    assert Path(where.strip()).is_relative_to(site)
    assert "table1" in asked("--help")
    asked("run", "table1", "--scale", "smoke", "--executor", "serial", "--tracking-uri", "none")
    report = empty / "runs" / "table1-smoke" / "report"
    assert (report / "index.html").is_file()
    assert "0.584" in (report / "table1.csv").read_text()  # the paper's
    provenance = json.loads((report.parent / "provenance.json").read_text())
    assert provenance["git_revision"] == "unknown"
