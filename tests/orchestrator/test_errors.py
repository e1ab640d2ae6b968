"""Packages that cannot be imported: one line, and a traceback for what is our own mistake."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.errors import explained


@pytest.mark.parametrize(
    ("package", "mistake", "said"),
    [
        ("mujoco", "raise ImportError('libGL.so.1 is missing')", "(ImportError: libGL.so.1 is"),
        ("mujoco", "None.glGetError", "(AttributeError: 'NoneType' object has no attribute"),
        ("mujoco", "import absent", "(ModuleNotFoundError: No module named 'absent')"),
        ("torch", "import ctypes; ctypes.CDLL('libtorch.so')", "(OSError: libtorch.so: cannot"),
    ],
)
def test_a_package_that_cannot_be_imported(
    tmp_path: Path, package: str, mistake: str, said: str
) -> None:
    (tmp_path / f"{package}.py").write_text(mistake)
    answer = subprocess.run(
        [sys.executable, "-m", "orchestrator.cli", "run", "table1", "--executor", "serial"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.getcwd()])},
        capture_output=True,
        text=True,
    )
    assert answer.returncode == 2
    *_, last = answer.stderr.splitlines()
    assert last.startswith(f"error: {package} cannot be imported {said}")
    assert last.endswith("`skillstitch doctor` says what to do")
    assert "Traceback" not in answer.stderr


def test_mistakes_of_ours_are_not_explained_away() -> None:
    for error in (ZeroDivisionError(), FileNotFoundError(2, "absent", "file"), KeyError("torch")):
        assert explained(error) is None
