"""Locks on folders, which the kernel drops with their process, however that ends."""

from __future__ import annotations

import fcntl
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestrator.errors import LockedError
from orchestrator.storage.store import make_folder, storage_errors

STORE_LOCK = "in-use.lock"  # another name than a run directory's: the two may be one folder


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a run directory; LockedError at once, naming the holder, if somebody else does."""
    with _locked_file(folder / "lock") as descriptor:
        if not _take(descriptor, folder, fcntl.LOCK_EX):
            holder = os.read(descriptor, 200).decode(errors="replace").strip()
            raise LockedError(
                f"{folder} is in use by {holder or 'another process'}; "
                "wait for it, or choose another --out"
            )
        with storage_errors(folder):
            os.ftruncate(descriptor, 0)
            holder = f"process {os.getpid()} on {socket.gethostname()}"
            os.pwrite(descriptor, holder.encode(), 0)
        yield


@contextmanager
def shared(store: Path, say: Callable[[str], None]) -> Iterator[None]:
    """Use a store beside others. Says so, and waits, where somebody has it `alone`."""
    with _locked_file(store / STORE_LOCK) as descriptor:
        if not _take(descriptor, store, fcntl.LOCK_SH):
            say(f"waiting for the gc of {store} to end")
            fcntl.flock(descriptor, fcntl.LOCK_SH)
        yield


@contextmanager
def alone(store: Path) -> Iterator[None]:
    """Have a store that nobody else uses; LockedError at once if somebody does."""
    with _locked_file(store / STORE_LOCK) as descriptor:
        if not _take(descriptor, store, fcntl.LOCK_EX):
            raise LockedError(
                f"a run or a sweep is at work over {store}, and what it has made and not yet used "
                "must not be deleted; wait for it"
            )
        yield


@contextmanager
def _locked_file(path: Path) -> Iterator[int]:
    """A file to lock; closing it drops the lock."""
    make_folder(path.parent)
    with storage_errors(path.parent):
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _take(descriptor: int, folder: Path, kind: int) -> bool:
    try:
        with storage_errors(folder):  # some file systems have no locks
            fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
