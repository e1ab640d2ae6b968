"""The record of finished blocks: honest about damage, safe when killed or full."""

import hashlib
import re
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import IncompleteError, NondeterminismError, StorageError
from orchestrator.storage import ledger as ledgers
from orchestrator.storage.ledger import SCHEMA, Ledger, Outcome, PlayCounts


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[Ledger]:
    ledger = Ledger(tmp_path / "ledger.sqlite")
    yield ledger
    ledger.close()


def outcome(episodes: int = 3) -> Outcome:
    return Outcome(
        {
            "episode": np.arange(episodes),
            "success": np.arange(episodes) % 2 == 0,
            "snapshots": np.zeros((0, 2)),
            "value_start": np.linspace(0, 1, episodes, dtype=np.float32),
        }
    )


def test_outcomes_survive_the_journey(ledger: Ledger) -> None:
    ledger.record([("a", outcome(3).to_bytes()), ("b", outcome(5).to_bytes())])
    found = dict(ledger.outcomes(["b", "missing", "a"]))
    assert list(found) == ["b", "a"]
    for name, array in outcome(5).arrays.items():
        assert found["b"].arrays[name].dtype == array.dtype
        np.testing.assert_array_equal(found["b"].arrays[name], array)
    assert ledger.finished() == {"a", "b"}
    assert dict(ledger.raw(["a", "missing"])) == {"a": outcome(3).to_bytes()}


def test_the_same_arrays_give_the_same_bytes() -> None:
    turned = Outcome(dict(reversed(outcome().arrays.items())))
    assert turned.to_bytes() == outcome().to_bytes()
    strided = Outcome({name: np.repeat(a, 2, axis=0)[::2] for name, a in outcome().arrays.items()})
    assert strided.to_bytes() == outcome().to_bytes()


def test_the_same_block_twice(ledger: Ledger) -> None:
    ledger.record([("a", b"one")])
    ledger.record([("a", b"one"), ("a", b"one"), ("b", b"two")])
    assert ledger.finished() == {"a", "b"}


def test_other_bytes_for_the_same_block(ledger: Ledger) -> None:
    """Work that gives different results cannot be trusted: nothing of the batch is kept."""
    ledger.record([("a", b"one")])
    with pytest.raises(NondeterminismError, match="block a was played before") as caught:
        ledger.record([("b", b"two"), ("a", b"other")])
    assert caught.value.exit_code == 6
    for digest in (b"one", b"other"):
        assert hashlib.sha256(digest).hexdigest()[:12] in str(caught.value)
    assert dict(ledger.raw(["a", "b"])) == {"a": b"one"}
    ledger.record([("b", b"two")])
    assert ledger.finished() == {"a", "b"}


def test_a_damaged_block_is_never_handed_out(ledger: Ledger) -> None:
    ledger.record([("a", outcome().to_bytes())])
    damaged = bytearray(outcome().to_bytes())
    damaged[-1] ^= 1
    for read in (ledger.outcomes, ledger.raw):
        with sqlite3.connect(ledger.path) as db:
            db.execute("UPDATE blocks SET outcome = ? WHERE key = 'a'", (bytes(damaged),))
        with pytest.raises(IncompleteError, match="block a was damaged on disk"):
            list(read(["a"]))
        assert not ledger.finished()  # so the next command plays it again
        ledger.record([("a", outcome().to_bytes())])


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0", b"not a database at all" * 300])
def test_a_file_that_is_no_ledger(tmp_path: Path, content: bytes) -> None:
    """An empty file is a ledger that was killed at birth; anything else is refused by name."""
    path = tmp_path / "ledger.sqlite"
    path.write_bytes(content)
    if not content:
        Ledger(path).record([("a", b"one")])
        return
    with pytest.raises(StorageError, match=rf"{re.escape(str(path))} is damaged.* move it away"):
        Ledger(path)


def test_pages_gone_bad(ledger: Ledger) -> None:
    """What SQLite itself finds is named as well."""
    ledger.record([(f"block {i}", bytes(1000)) for i in range(100)])
    ledger.close()
    content = bytearray(ledger.path.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    ledger.path.write_bytes(content)
    for read in (Ledger.finished, lambda again: list(again.raw(["block 7"]))):
        with pytest.raises(StorageError, match=rf"{re.escape(str(ledger.path))} is damaged"):
            read(Ledger(ledger.path))


def test_a_reader_beside_the_writer(ledger: Ledger) -> None:
    ledger.record([("a", b"one")])
    reader = Ledger(ledger.path, read_only=True)
    ledger.record([("b", b"two")])
    assert reader.finished() == {"a", "b"}
    with pytest.raises(StorageError):
        reader.record([("c", b"three")])
    reader.close()


def test_a_reader_makes_no_ledger(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=re.escape(str(tmp_path / "none.sqlite"))):
        Ledger(tmp_path / "none.sqlite", read_only=True)
    assert list(tmp_path.iterdir()) == []


def test_a_reader_of_what_a_writer_left_half_done(tmp_path: Path) -> None:
    """A rollback journal, as lies there when a kill comes before the ledger is in WAL mode."""
    path = tmp_path / "ledger.sqlite"
    script = (
        "import os, signal, sqlite3, sys\n"
        "db = sqlite3.connect(sys.argv[1], isolation_level=None)\n"
        "db.execute('CREATE TABLE other (x)')\n"
        "db.executescript('PRAGMA cache_size = 1; BEGIN; ' + "
        "'INSERT INTO other VALUES (randomblob(5000));' * 50)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert path.with_name("ledger.sqlite-journal").stat().st_size > 0
    reader = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
    with pytest.raises(sqlite3.OperationalError):
        reader.execute("SELECT * FROM other")
    reader.close()
    Ledger(path, read_only=True).close()


def test_a_writer_killed_before_it_had_made_the_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readers find nothing played; the next writer goes on."""
    path = tmp_path / "ledger.sqlite"
    with monkeypatch.context() as killed:
        killed.setattr(ledgers, "SCHEMA", SCHEMA.replace("COMMIT;", "killed"))
        with pytest.raises(StorageError):
            Ledger(path)
    assert path.is_file()
    for reader in (Ledger(path, read_only=True), Ledger.look(path)):
        assert not reader.finished()
        assert not reader.artifacts()
        assert reader.history() == {}
        assert reader.failures() == {}
        with pytest.raises(StorageError):
            reader.record([("a", b"one")])
        reader.close()
    writer = Ledger(path)
    writer.record([("a", b"one")])
    assert Ledger.look(path).finished() == {"a"}


def test_artifacts_keep_their_first_digest(ledger: Ledger) -> None:
    assert ledger.record_artifact("agent", "1234") == "1234"
    assert ledger.record_artifact("agent", "5678") == "1234"


def test_failures_are_counted_across_sessions(ledger: Ledger) -> None:
    assert [ledger.record_failure("a", f"error {i}") for i in range(2)] == [1, 2]
    ledger.close()
    again = Ledger(ledger.path)
    assert again.record_failure("a", "last") == 3
    assert again.record_failure("b", "other") == 1
    assert again.failures() == {"a": (3, "last"), "b": (1, "other")}
    again.close()


def test_history_adds_up(ledger: Ledger) -> None:
    ledger.add_played("first skills", PlayCounts(10, 8, 1.0))
    ledger.add_played("first skills", PlayCounts(30, 12, 1.0))
    assert ledger.history() == {"first skills": PlayCounts(40, 20, 2.0)}
    assert ledger.history()["first skills"].seconds_each == 0.05
    assert ledger.history()["first skills"].success_rate == 0.5


def test_forgotten_blocks_give_their_space_back(ledger: Ledger) -> None:
    ledger.record([(f"block {i}", bytes(10_000)) for i in range(100)])
    ledger.forget({f"block {i}" for i in range(99)})
    assert ledger.finished() == {"block 99"}
    ledger.shrink()
    ledger.close()
    assert ledger.path.stat().st_size < 100_000


# Killed at any moment

APPEND = """
import hashlib, sys
from pathlib import Path
from orchestrator.storage.ledger import Ledger
ledger = Ledger(Path(sys.argv[1]))
number = len(ledger.finished())
while True:
    names = [f"{number + i}" for i in range(3)]
    ledger.record([(name, hashlib.sha256(name.encode()).digest() * 500) for name in names])
    number += 3
    print(number, flush=True)
"""


def test_every_committed_block_survives_a_kill(tmp_path: Path) -> None:
    """Killed again and again while it appends; what it said it had, it has, in whole batches."""
    path = tmp_path / "ledger.sqlite"
    rng = np.random.default_rng(0)
    committed = 0
    for _ in range(4):
        writer = subprocess.Popen(
            [sys.executable, "-c", APPEND, str(path)], stdout=subprocess.PIPE, text=True
        )
        assert writer.stdout is not None
        for _ in range(int(rng.integers(1, 40))):
            committed = int(writer.stdout.readline())
        writer.send_signal(signal.SIGKILL)
        said = writer.stdout.read().split()
        writer.wait()
        committed = int(said[-1]) if said else committed

        ledger = Ledger(path)
        kept = ledger.finished()
        assert len(kept) >= committed
        assert len(kept) % 3 == 0
        assert kept == {str(i) for i in range(len(kept))}
        for key, data in ledger.raw(kept):
            assert data == hashlib.sha256(key.encode()).digest() * 500
        ledger.close()
        committed = len(kept)


# A full disk


def test_a_full_disk_loses_nothing_and_recovers(ledger: Ledger) -> None:
    ledger.record([("a", b"one")])
    (pages,) = ledger._db.execute("PRAGMA page_count").fetchone()
    ledger._db.execute(f"PRAGMA max_page_count = {pages + 2}")
    with pytest.raises(StorageError, match="make room and run the same command again") as caught:
        ledger.record([("b", b"two"), ("c", bytes(10**6))])
    assert caught.value.exit_code == 3
    assert str(ledger.path) in str(caught.value)
    assert ledger.finished() == {"a"}
    ledger.record([("b", b"two")])  # what is small still fits

    ledger._db.execute("PRAGMA max_page_count = 1000000")
    ledger.record([("c", bytes(10**6))])
    assert ledger.finished() == {"a", "b", "c"}


def test_a_folder_that_cannot_be_written_to(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"in the way")
    for path in (tmp_path / "file" / "ledger.sqlite", tmp_path / "file" / "below" / "l.sqlite"):
        with pytest.raises(StorageError, match=rf"{tmp_path / 'file'}.*choose another place"):
            Ledger(path)
