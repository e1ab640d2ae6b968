"""The record of finished blocks: one SQLite file, one writer, torn-write safe."""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors.numpy import load, save

from orchestrator.errors import IncompleteError, NondeterminismError, StorageError
from orchestrator.storage.store import make_folder

SCHEMA = """
BEGIN;
CREATE TABLE IF NOT EXISTS blocks (
    key TEXT PRIMARY KEY, digest TEXT NOT NULL, outcome BLOB NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS artifacts (
    key TEXT PRIMARY KEY, digest TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS failures (
    key TEXT NOT NULL, attempt INTEGER NOT NULL, error TEXT NOT NULL, PRIMARY KEY (key, attempt)
);
CREATE TABLE IF NOT EXISTS played (
    name TEXT PRIMARY KEY, segments INTEGER NOT NULL, successes INTEGER NOT NULL,
    seconds REAL NOT NULL
) WITHOUT ROWID;
COMMIT;
"""


@dataclass(frozen=True)
class Outcome:
    """What a block's episodes did: `BlockPlayer.outcome`'s arrays by name, a row an episode."""

    arrays: dict[str, np.ndarray]

    @property
    def survivors(self) -> int:
        """Episodes that accomplished the skill and so go on."""
        return int(self.arrays["success"].sum())

    def to_bytes(self) -> bytes:
        """The same arrays give the same bytes."""
        return save({name: np.asarray(array, order="C") for name, array in self.arrays.items()})

    @staticmethod
    def from_bytes(data: bytes) -> Outcome:
        return Outcome(load(data))


@dataclass(frozen=True)
class PlayCounts:
    """What segments of one kind took and came to."""

    segments: int
    successes: int
    seconds: float  # of one worker

    @property
    def seconds_each(self) -> float:
        return self.seconds / self.segments

    @property
    def success_rate(self) -> float:
        return self.successes / self.segments

    def __add__(self, other: PlayCounts) -> PlayCounts:
        return PlayCounts(
            self.segments + other.segments,
            self.successes + other.successes,
            self.seconds + other.seconds,
        )


class Ledger:
    """Truth about what was simulated. The driver alone adds to it.

    A run directory has one; the store keeps another with every block that any run ever finished,
    so that a run finds what an earlier one has already played.
    """

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        self.path = path
        with self._storage_errors():
            if read_only:
                # Not mode=ro: what a killed writer left half-done may have to be rolled back first.
                there = f"{path.resolve().as_uri()}?mode=rw"
                self._db = sqlite3.connect(there, uri=True, timeout=30)
                if not self._has_tables():  # it was killed before it had made them
                    self._db.close()
                    self._db = sqlite3.connect(":memory:")
                    self._db.executescript(SCHEMA)
                self._db.execute("PRAGMA query_only = 1")
                return
            make_folder(path.parent)
            self._db = sqlite3.connect(path, timeout=30, isolation_level=None)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=FULL")
            self._db.executescript(SCHEMA)

    def _has_tables(self) -> bool:
        (count,) = self._db.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        return bool(count)

    @classmethod
    def look(cls, path: Path) -> Ledger:
        """To read what is there, which may be nothing; makes no file."""
        return cls(path, read_only=True) if path.exists() else cls(Path(":memory:"))

    def close(self) -> None:
        self._db.close()

    def record(self, outcomes: Iterable[tuple[str, bytes]]) -> None:
        """Append finished blocks in one transaction.

        Raises NondeterminismError if a block is already recorded with other bytes.
        """
        rows = [(key, hashlib.sha256(data).hexdigest(), data) for key, data in outcomes]
        with self._transaction():
            for key, digest, data in rows:
                self._db.execute(
                    "INSERT OR IGNORE INTO blocks VALUES (?, ?, ?)", (key, digest, data)
                )
                (known,) = self._db.execute(
                    "SELECT digest FROM blocks WHERE key = ?", (key,)
                ).fetchone()
                if known != digest:
                    raise NondeterminismError(
                        f"{self.path}: block {key} was played before with other bytes "
                        f"({known[:12]} then, {digest[:12]} now): the same work gave different "
                        "results, so the code or the machine is not deterministic"
                    )

    def finished(self) -> set[str]:
        with self._storage_errors():
            keys = {key for (key,) in self._db.execute("SELECT key FROM blocks")}
            if None in keys:  # as where the end of the file is missing
                raise sqlite3.DatabaseError("a block has no name")
            return keys

    def outcomes(self, keys: Iterable[str]) -> Iterator[tuple[str, Outcome]]:
        """Recorded outcomes in the order asked for; keys not recorded are skipped.

        Raises IncompleteError when stored bytes no longer match their digest; that block is
        forgotten, so the next command plays it again.
        """
        return ((key, Outcome.from_bytes(data)) for key, data in self.raw(keys))

    def raw(self, keys: Iterable[str]) -> Iterator[tuple[str, bytes]]:
        """The same as bytes, as `record` takes them."""
        for key in keys:
            with self._storage_errors():
                row = self._db.execute(
                    "SELECT digest, outcome FROM blocks WHERE key = ?", (key,)
                ).fetchone()
            if row is None:
                continue
            digest, data = row
            if hashlib.sha256(data).hexdigest() != digest:
                self.forget([key])
                raise IncompleteError(
                    f"{self.path}: block {key} was damaged on disk and has been removed; "
                    "the same command plays it again"
                )
            yield key, data

    def record_artifact(self, key: str, digest: str) -> str:
        """Remember which bytes an artifact had when blocks were played; returns those on record."""
        with self._transaction():
            self._db.execute("INSERT OR IGNORE INTO artifacts VALUES (?, ?)", (key, digest))
            (known,) = self._db.execute(
                "SELECT digest FROM artifacts WHERE key = ?", (key,)
            ).fetchone()
        return str(known)

    def artifacts(self) -> dict[str, str]:
        """Key → digest, of all artifacts that blocks were played with."""
        with self._storage_errors():
            return dict(self._db.execute("SELECT key, digest FROM artifacts"))

    def record_failure(self, key: str, error: str) -> int:
        """Count a failed attempt at a block; returns how many there have been."""
        with self._transaction():
            (count,) = self._db.execute(
                "SELECT COUNT(*) FROM failures WHERE key = ?", (key,)
            ).fetchone()
            self._db.execute("INSERT INTO failures VALUES (?, ?, ?)", (key, count + 1, error))
        return int(count) + 1

    def failures(self) -> dict[str, tuple[int, str]]:
        """Attempts and last error of every block that ever failed."""
        with self._storage_errors():
            rows = self._db.execute(
                "SELECT key, attempt, error FROM failures ORDER BY key, attempt"
            )
            return {key: (attempt, error) for key, attempt, error in rows}

    def forget(self, keys: Iterable[str]) -> None:
        """Remove blocks."""
        with self._transaction():
            self._db.executemany("DELETE FROM blocks WHERE key = ?", [(key,) for key in keys])

    def shrink(self) -> None:
        """Give the space of removed blocks back to the disk."""
        with self._storage_errors():
            self._db.execute("VACUUM")

    def add_played(self, name: str, played: PlayCounts) -> None:
        """Remember how playing segments of a kind went, for later estimates."""
        with self._transaction():
            self._db.execute(
                "INSERT INTO played VALUES (?, ?, ?, ?) ON CONFLICT (name) DO UPDATE SET "
                "segments = segments + excluded.segments, "
                "successes = successes + excluded.successes, seconds = seconds + excluded.seconds",
                (name, played.segments, played.successes, played.seconds),
            )

    def history(self) -> dict[str, PlayCounts]:
        """All that was ever played, by kind of segment."""
        with self._storage_errors():
            rows = self._db.execute("SELECT * FROM played WHERE segments > 0")
            return {name: PlayCounts(*counts) for name, *counts in rows}

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._storage_errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")

    @contextmanager
    def _storage_errors(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            if getattr(self, "_db", None) is not None and self._db.in_transaction:
                self._db.execute("ROLLBACK")
            if "locked" in str(error):
                raise IncompleteError(
                    f"{self.path} is held by another process; wait and run the same command again"
                ) from error
            raise StorageError(
                f"cannot write {self.path}: {error}; make room and run the same command again"
            ) from error
        except sqlite3.DatabaseError as error:
            raise StorageError(
                f"{self.path} is damaged: {error}; move it away and run the same command again "
                "(run directory and store both keep the finished blocks)"
            ) from error
