"""SQLite stores that are missing, locked, deleted or shared; servers that are down."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from orchestrator.tracking import default_uri, publish, stores
from tests.orchestrator.tracking.fake_run import Seen, finish_run, rewind, start_run, train_run


def test_a_server_that_is_down_is_said_in_one_line(run_dir: Path) -> None:
    with closing(socket.socket()) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    uri = f"http://user:secret@127.0.0.1:{port}"
    start = time.monotonic()
    outcome = publish(run_dir, uri, "FINISHED")
    assert time.monotonic() - start < 15
    assert not outcome.ok
    assert "\n" not in outcome.error
    assert f"127.0.0.1:{port}" in outcome.error
    assert "secret" not in outcome.error + (run_dir / "tracking.json").read_text()
    assert not publish(run_dir, uri, "FINISHED").skipped


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("http://server:5000", "http://server:5000"),
        ("http://user:word@server:5000", "http://server:5000"),
        ("http://token@server", "http://server"),
        ("postgresql://u:p@ss@host/db", "postgresql://host/db"),
        ("postgresql://u:p/w@host/db", "postgresql://host/db"),
        ("postgresql://u:p?w@host/db", "postgresql://host/db"),
        (
            "postgresql://host/db?user=u&password=secret&sslmode=require",
            "postgresql://host/db?user=***&password=***&sslmode=require",
        ),
        ("sqlite:////runs/mlflow.db?timeout=5", "sqlite:////runs/mlflow.db?timeout=5"),
        ("no http://u:p@a and 'http://v:q/@b': gone", "no http://a and 'http://b': gone"),
    ],
)
def test_users_and_passwords_are_left_out(uri: str, said: str) -> None:
    assert stores.without_password(uri) == said


def test_a_sqlite_store_with_a_query(run_dir: Path, uri: str, tmp_path: Path) -> None:
    with_query = f"{uri}?timeout=5&check_same_thread=false"
    outcome = publish(run_dir, with_query, "FINISHED")
    assert outcome.ok, outcome.error
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})
    assert not [path.name for path in tmp_path.iterdir() if "?" in path.name]
    assert stores.is_gone(f"sqlite:///{tmp_path}/absent.db?timeout=5")


def test_a_path_with_a_question_mark_is_no_query(run_dir: Path, tmp_path: Path) -> None:
    outcome = publish(run_dir, f"sqlite:///{tmp_path}/seed?1/mlflow.db", "FINISHED")
    assert "a path with “?” or “%”" in outcome.error


@contextmanager
def locked(database: Path) -> Iterator[None]:
    """Another process holds the database."""
    code = (
        "import sqlite3, sys\n"
        f"connection = sqlite3.connect({str(database)!r})\n"
        "connection.execute('BEGIN EXCLUSIVE')\n"
        "print('locked', flush=True); sys.stdin.read()"
    )
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"locked\n"
        yield
        holder.communicate()


def test_a_locked_database_is_said_and_made_up_for_later(
    run_dir: Path, uri: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stores, "LOCK_SECONDS", 1.0)
    with locked(Path(uri.removeprefix("sqlite:///"))):
        start = time.monotonic()
        outcome = publish(run_dir, uri, "FINISHED")
        assert time.monotonic() - start < 5
        assert not outcome.ok
        assert "locked" in outcome.error
    made_up_for = publish(run_dir, uri, "FINISHED")
    assert made_up_for.ok
    assert not made_up_for.skipped
    assert publish(run_dir, uri, "FINISHED").skipped


@pytest.mark.parametrize(("name", "ok"), [("seed#1 a", True), ("50%23", False), ("why?", False)])
def test_a_folder_whose_name_means_something_in_a_uri(
    run_dir: Path, tmp_path: Path, name: str, ok: bool
) -> None:
    """It is used, or refused in one line; no other folder appears."""
    folder = tmp_path / "kept" / name
    folder.mkdir(parents=True)
    outcome = publish(run_dir, default_uri(folder), "FINISHED")
    assert outcome.ok == ok
    assert (folder / "mlflow.db").exists() == ok
    assert ok or "--tracking-uri sqlite:///FILE" in outcome.error
    assert list(folder.parent.iterdir()) == [folder]


@pytest.mark.parametrize("uri", ["nonsense://x", "sqlite:////proc/nowhere/mlflow.db"])
def test_a_store_that_cannot_be_is_no_reason_to_stop(run_dir: Path, uri: str) -> None:
    outcome = publish(run_dir, uri, "FINISHED")
    assert not outcome.ok
    assert outcome.error


def test_a_deleted_experiment_is_named(run_dir: Path, uri: str) -> None:
    publish(run_dir, uri, "FINISHED")
    seen = Seen(uri)
    seen.client.delete_experiment(seen.experiment)
    rewind(run_dir)
    assert "skillstitch/maze was deleted" in publish(run_dir, uri, "FINISHED").error


def spawn(run_dir: Path, uri: str) -> subprocess.Popen[bytes]:
    code = (
        "from pathlib import Path; from orchestrator.tracking import publish\n"
        f"outcome = publish(Path({str(run_dir)!r}), {uri!r}, 'FINISHED')\n"
        "assert outcome.ok, outcome.error"
    )
    return subprocess.Popen([sys.executable, "-c", code])


def test_runs_that_publish_to_one_new_store_at_the_same_time(tmp_path: Path) -> None:
    runs = {
        name: finish_run(train_run(start_run(tmp_path / name, run_id=name)))
        for name in ("one", "two")
    }
    uri = default_uri(tmp_path)  # nobody has created the schema yet
    processes = [spawn(run_dir, uri) for run_dir in runs.values()]
    assert [process.wait() for process in processes] == [0, 0]
    for name in runs:
        assert Seen(uri, run_id=name).states() == ("FINISHED", {"FINISHED"})


def test_a_schema_that_another_thread_creates(run_dir: Path, tmp_path: Path) -> None:
    (tmp_path / "mlflow.db.new").write_bytes(b"what a kill left of an earlier attempt")
    uri = default_uri(tmp_path)
    other = finish_run(train_run(start_run(tmp_path / "other", run_id="other")))
    thread = threading.Thread(target=publish, args=(other, uri, "FINISHED"))
    thread.start()
    assert publish(run_dir, uri, "FINISHED").ok
    thread.join()
    assert Seen(uri).states() == ("FINISHED", {"FINISHED"})
    assert not (tmp_path / "mlflow.db.new").exists()
