"""Files and folders that are there whole or not at all, whenever the process is killed."""

import ctypes
import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

AT_FDCWD, RENAME_EXCHANGE = -100, 2  # of renameat2(2)


@contextmanager
def replaced_file(target: Path) -> Iterator[Path]:
    """A path to write to, which becomes the target once the block is left without an error."""
    draft = _draft(target)
    try:
        yield draft
        sync(draft)
        draft.replace(target)
        sync(target.parent)
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def replaced_folder(target: Path) -> Iterator[Path]:
    """An empty folder to fill, which becomes the target once the block is left without an error.

    Nothing of the old target stays.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = _draft(target)
    draft.mkdir()
    try:
        yield draft
        for path in (*draft.rglob("*"), draft):
            sync(path)
        _put_in_place(draft, target)
        sync(target.parent)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def can_write(folder: Path) -> bool:
    """Whether a file can be made in a folder, which is tried: permissions do not tell all."""
    try:
        with TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def existing_above(path: Path) -> Path:
    """The path itself, or the nearest folder above it that is there.

    Raises OSError where it cannot be looked at: a name that is too long, a folder closed to us.
    """
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return existing_above(path.absolute().parent)
    return path


def sync(path: Path) -> None:
    """Flush a file, or a folder's names, to the device, where the file system can do that."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise  # some network and user-space file systems cannot for folders; these say so
    finally:
        os.close(descriptor)


def _draft(target: Path) -> Path:
    """A hidden sibling of this process's own; those of processes that were killed are removed."""
    for left in target.parent.glob(f".{target.name}.*.tmp"):
        process = left.name.split(".")[-2]
        if process.isdigit() and not _alive(int(process)):
            shutil.rmtree(left) if left.is_dir() else left.unlink()
    return target.with_name(f".{target.name}.{os.getpid()}.tmp")


def _alive(process: int) -> bool:
    """Whether another process has this number."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # somebody else's
        return True
    return process != os.getpid()


def _put_in_place(draft: Path, target: Path) -> None:
    """Afterwards the old target, if any, is at `draft`."""
    if not target.exists():
        draft.rename(target)
    elif not _exchange(draft, target):
        # Killed between the two renames, neither is there; what called builds it anew next time.
        aside = draft.with_name(f".{target.name}.old.{os.getpid()}.tmp")
        target.rename(aside)
        draft.rename(target)
        aside.rename(draft)


def _exchange(first: Path, second: Path) -> bool:
    """Swap two paths in one step; False where the system or the file system cannot."""
    renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)
    if renameat2 is None:
        return False
    paths = os.fsencode(first), os.fsencode(second)
    return bool(renameat2(AT_FDCWD, paths[0], AT_FDCWD, paths[1], RENAME_EXCHANGE) == 0)
