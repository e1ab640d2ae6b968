"""Homes, temporary folders and installations that cannot be written to; MuJoCo without drawing."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from analysis.backends import CHOSEN, backends
from orchestrator import libraries
from orchestrator.errors import UsageError
from tests.orchestrator.tiny import TINY, Place

NOWHERE = "/proc/none"  # where even root can make nothing


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """An environment as after a login, and nobody's folder in the temporary place."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with mock.patch.dict(os.environ, {"HOME": str(tmp_path)}):
        for name in list(os.environ):
            if name.startswith(("XDG_", "MPL", "NUMBA", "RAY_", "MUJOCO", CHOSEN)):
                del os.environ[name]
        yield


def test_where_libraries_can_write_they_are_left_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(libraries, "numba_can_write", lambda: True)  # tested on its own below
    before = dict(os.environ)
    libraries.give_places()
    assert dict(os.environ) == before


def test_matplotlib_gets_a_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", NOWHERE)
    libraries.give_places()
    folder = tmp_path / f"skillstitch-{os.getuid()}"
    assert os.environ["MPLCONFIGDIR"] == str(folder / "matplotlib")
    assert folder.stat().st_mode & 0o777 == 0o700
    libraries.give_places()  # which can be written to now
    assert os.environ["MPLCONFIGDIR"] == str(folder / "matplotlib")


def test_a_folder_of_somebody_else_is_not_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Compiled code is read from it."""
    name = f"skillstitch-{os.getuid()}"
    (tmp_path / name).mkdir(mode=0o777)
    (tmp_path / name).chmod(0o777)
    assert libraries.own_folder().parent != tmp_path
    (tmp_path / name).rmdir()
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / name).symlink_to(tmp_path / "elsewhere")
    assert libraries.own_folder().parent != tmp_path
    (tmp_path / name).unlink()
    assert libraries.own_folder() == tmp_path / name


def test_no_temporary_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "_temporary_places", lambda: [Path(NOWHERE)])
    monkeypatch.setenv("HOME", NOWHERE)
    with pytest.raises(UsageError, match=r"set TMPDIR to one that can be$"):
        libraries.own_folder()
    monkeypatch.setenv("TMPDIR", NOWHERE)
    with pytest.raises(UsageError, match=r"whose name has at most 28 characters$"):
        libraries.ray_folder()
    libraries.give_places()
    assert "MPLCONFIGDIR" not in os.environ


@pytest.mark.parametrize("variable", ["TMPDIR", "RAY_TMPDIR"])
@pytest.mark.parametrize("where", [NOWHERE, "t" * 81])
def test_ray_gets_a_short_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, variable: str, where: str
) -> None:
    monkeypatch.setenv("TMPDIR", "/tmp")
    assert libraries.ray_folder() is None
    monkeypatch.setenv(variable, str(tmp_path / where))
    folder = libraries.ray_folder()
    assert folder is not None
    assert len(folder) <= libraries.LONGEST
    assert libraries.could_write(Path(folder))


def test_ray_gets_a_token_where_it_cannot_leave_one(monkeypatch: pytest.MonkeyPatch) -> None:
    libraries.give_ray_a_token()
    assert "RAY_AUTH_TOKEN" not in os.environ
    monkeypatch.setenv("HOME", NOWHERE)
    libraries.give_ray_a_token()
    assert len(os.environ["RAY_AUTH_TOKEN"]) == 64


def test_drawing_is_set_aside_and_pictures_get_what_the_user_chose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert backends() == ["egl", "osmesa"]
    monkeypatch.setenv("MUJOCO_GL", "OSMesa")
    assert backends() == ["osmesa", "egl"]
    libraries.set_drawing_aside()
    libraries.set_drawing_aside()  # as in a process started by another
    assert os.environ["MUJOCO_GL"] == "disable"
    assert backends() == ["osmesa", "egl"]
    monkeypatch.setenv(CHOSEN, "glfw")
    assert backends() == ["glfw", "egl", "osmesa"]
    monkeypatch.setenv(CHOSEN, "nonsense")
    assert backends() == ["egl", "osmesa"]


def command(*words: object, **environment: str) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, as libraries are imported once."""
    line = [sys.executable, "-m", "orchestrator.cli", *map(str, words)]
    return subprocess.run(line, env=os.environ | environment, capture_output=True, text=True)


@pytest.mark.parametrize("choice", ["osmesa", "nonsense"])
def test_a_plan_draws_nothing(choice: str) -> None:
    answer = command("plan", "table3", "--scale", "smoke", MUJOCO_GL=choice)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_a_report_where_home_cannot_be_written_to(done: Place) -> None:
    command("report", done.out, HOME=NOWHERE)  # matplotlib may say once that it looks for fonts
    answer = command("report", done.out, HOME=NOWHERE)
    assert (answer.returncode, answer.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.ray
def test_a_run_where_neither_home_nor_the_temporary_folder_can_be_written_to(place: Place) -> None:
    """By a Ray of its own."""
    paths = ["--out", place.out, "--store", place.store_root]
    answer = command(
        "run", TINY, *paths, "--workers", 1, HOME=NOWHERE, TMPDIR=NOWHERE, MUJOCO_GL="osmesa"
    )
    assert answer.returncode == 0, answer.stderr


READ_ONLY = """
mount --bind "$1" "$1" && mount -o remount,ro,bind "$1" || exit 77
shift
exec "$@"
"""
IMPORT = """
from orchestrator.libraries import give_places
give_places()
import robosuite
"""


def test_robosuite_in_a_read_only_installation() -> None:
    """In a mount namespace of its own, as root may write to everything else."""
    if os.getuid() != 0 or shutil.which("unshare") is None:
        pytest.skip("only root can mount")
    python = [sys.executable, "-c", IMPORT]
    mounted = ["unshare", "--mount", "sh", "-c", READ_ONLY, "sh", sys.prefix]
    environment = os.environ | {"HOME": NOWHERE, "PYTHONPATH": os.getcwd()}
    answer = subprocess.run([*mounted, *python], env=environment, capture_output=True, text=True)
    if answer.returncode == 77 or answer.stderr.startswith("unshare: "):
        pytest.skip("no mounts here")
    assert answer.returncode == 0, answer.stderr
