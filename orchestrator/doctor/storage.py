"""Where runs are kept: room, and whether files, locks and databases work there."""

from __future__ import annotations

import errno
import fcntl
import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

from analysis.files import existing_above
from orchestrator.doctor.finding import GIB, Finding, gib

LEAST_DISK, ENOUGH_DISK = 1 * GIB, 10 * GIB


def check_root(root: Path) -> list[Finding]:
    """Room, and whether files, locks and databases work there: network disks may lack some.

    What is not there yet is not made: the nearest folder above it is looked at.
    """
    try:
        there = existing_above(root)
        with tempfile.TemporaryDirectory(prefix=".doctor-", dir=there) as folder:
            findings = [check_locks(Path(folder)), check_wal(Path(folder))]
    except OSError as error:
        advice = "choose another --out, or make this a directory that you may write to"
        return [Finding("writing", "fault", f"{root}: {error.strerror}", advice)]
    return [
        Finding("writing", "ok", str(root)),
        judge_disk(shutil.disk_usage(there).free),
        *findings,
    ]


def judge_disk(free: int) -> Finding:
    """Whether so many free bytes are enough."""
    found = f"{free / GIB:.1f} GiB free"
    if free < LEAST_DISK:
        return Finding("disk", "fault", found, f"free {gib(LEAST_DISK)}, or choose another --out")
    if free < ENOUGH_DISK:
        advice = f"enough for a smoke run; a full reproduction wants {gib(ENOUGH_DISK)}"
        return Finding("disk", "warn", found, advice)
    return Finding("disk", "ok", found)


def check_locks(folder: Path) -> Finding:
    """A lock that is held must keep a second one out, or two launches would share a run."""
    with (folder / "lock").open("wb") as first, (folder / "lock").open("wb") as second:
        try:
            fcntl.flock(first, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno == errno.EWOULDBLOCK:
                return Finding("file locks", "ok", "work")
    advice = "keep runs on a local disk: two launches here could damage each other"
    return Finding("file locks", "fault", "do not work", advice)


def check_wal(folder: Path) -> Finding:
    """Whether SQLite can write ahead in a folder: not on network disks."""
    with closing(sqlite3.connect(folder / "database")) as connection:
        (mode,) = connection.execute("PRAGMA journal_mode=WAL").fetchone()
        connection.execute("CREATE TABLE t (x)")
    if mode == "wal":
        return Finding("SQLite WAL", "ok", "works")
    return Finding("SQLite WAL", "fault", f"journal mode {mode}", "keep runs on a local disk")
