import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from analysis import files
from analysis.files import can_write, replaced_file, replaced_folder, sync

REWRITE_FOR_EVER = """
import sys
from itertools import count
from pathlib import Path
from analysis.files import replaced_file, replaced_folder

place = Path(sys.argv[1])
for version in count():
    with replaced_folder(place / "folder") as draft:
        for name in ("first", "second"):
            (draft / name).write_text(str(version))
    with replaced_file(place / "file") as draft:
        draft.write_text(str(version) * 1000)
"""


@pytest.fixture(params=["in one step", "in two renames"])
def either_way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "in two renames":
        monkeypatch.setattr(files, "_exchange", lambda *_: False)


def write(folder: Path, name: str) -> None:
    with replaced_folder(folder) as draft:
        (draft / name).write_text("new")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("either_way")
def test_nothing_of_the_old_folder_stays(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write(tmp_path / "deep" / "folder", name)
        assert names(tmp_path / "deep" / "folder") == [name]
    assert names(tmp_path / "deep") == ["folder"]


def test_an_error_leaves_the_old(tmp_path: Path) -> None:
    write(tmp_path / "folder", "old")
    (tmp_path / "file").write_text("old")
    with pytest.raises(FileNotFoundError):
        write(tmp_path / "folder", "absent/new")
    with pytest.raises(UnicodeEncodeError), replaced_file(tmp_path / "file") as draft:
        draft.write_text("new\udc80", encoding="utf-8")
    assert names(tmp_path) == ["file", "folder"]
    assert names(tmp_path / "folder") == ["old"]
    assert (tmp_path / "file").read_text() == "old"


def test_a_killed_process_leaves_the_old_or_the_new(tmp_path: Path) -> None:
    folder, file = tmp_path / "folder", tmp_path / "file"
    for _ in range(5):
        with subprocess.Popen([sys.executable, "-c", REWRITE_FOR_EVER, str(tmp_path)]) as process:
            before = file.stat().st_mtime_ns if file.exists() else 0
            while not file.exists() or file.stat().st_mtime_ns == before:
                time.sleep(0.002)
            process.send_signal(signal.SIGKILL)
        versions = {(folder / name).read_text() for name in ("first", "second")}
        assert len(versions) == 1
        text = file.read_text()
        assert text == text[: len(text) // 1000] * 1000


def test_what_killed_processes_left_is_removed_and_what_others_write_is_not(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as gone:
        pass
    (tmp_path / f".folder.{gone.pid}.tmp").mkdir()
    (tmp_path / f".folder.old.{gone.pid}.tmp").mkdir()
    (tmp_path / f".folder.{os.getppid()}.tmp").mkdir()
    write(tmp_path / "folder", "a")
    assert names(tmp_path) == [f".folder.{os.getppid()}.tmp", "folder"]


def test_a_file_system_that_cannot_flush_folders(tmp_path: Path) -> None:
    for folder in (tmp_path, Path("/proc")):
        sync(folder)
    with pytest.raises(FileNotFoundError):
        sync(tmp_path / "absent")


def test_whether_a_file_can_be_made(tmp_path: Path) -> None:
    """Permissions alone say that root may write to /proc."""
    (tmp_path / "file").touch()
    assert can_write(tmp_path)
    assert names(tmp_path) == ["file"]
    for folder in (tmp_path / "file", tmp_path / "absent", Path("/proc")):
        assert not can_write(folder)
