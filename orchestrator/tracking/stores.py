"""MLflow's stores: how to connect to one, and how to take turns at a SQLite file."""

from __future__ import annotations

import fcntl
import logging
import os
import re
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mlflow import MlflowClient

SETTINGS = {
    "DO_NOT_TRACK": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "5",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
TURN_SECONDS = 30.0  # wait for another skillstitch that writes to the same SQLite store
LOCK_SECONDS = 10.0  # wait for any other program that has locked it

SQLITE = "sqlite:///"
QUERY = re.compile(r"\w+=[\w.+-]*(&\w+=[\w.+-]*)*")  # of a SQLite store: timeout=5
BEFORE_HOST = re.compile(r"//([^/:@\s]*|[^/:@\s]*:[^\s'\"]*)@")
IN_QUERY = re.compile(
    r"([?&;][\w.-]*(?:user|pass|pwd|secret|token|key)[\w.-]*=)[^&;\s'\"]*", re.IGNORECASE
)


class TrackingError(Exception):
    """Tracking cannot be used now; the message says why."""


def default_uri(root: Path) -> str:
    """A SQLite store under `root`; its artifacts go to the folder `mlartifacts` beside it."""
    return f"sqlite:///{root.resolve() / 'mlflow.db'}"


def without_password(text: str) -> str:
    """A URI, or a text with URIs, without the users and passwords in them.

    Passwords may have "@" and "/" in them, so all up to a word's last "@" goes.
    """
    return IN_QUERY.sub(r"\1***", BEFORE_HOST.sub("//", text))


def _database(uri: str) -> Path | None:
    """The file of a SQLite store, None for any other."""
    if not uri.startswith(SQLITE):
        return None
    path, _, query = uri.removeprefix(SQLITE).rpartition("?")
    return Path(path if QUERY.fullmatch(query) and path else uri.removeprefix(SQLITE))


def is_gone(uri: str) -> bool:
    """Whether a store is a database file that is not there."""
    database = _database(uri)
    return database is not None and not database.exists()


@contextmanager
def turn_to_write(uri: str) -> Iterator[None]:
    """One publisher at a time for a SQLite store; servers see to that themselves.

    Raises TrackingError if the store stays locked, which is asked up front, because MLflow itself
    would wait 20 seconds in every single call; and for a path with "?" or "%": MLflow and its
    database library read such a URI differently.
    """
    database = _database(uri)
    if database is None:
        yield
        return
    if "?" in str(database) or "%" in uri:
        raise TrackingError(
            f"MLflow cannot keep a SQLite store at a path with “?” or “%”, as {database} has: "
            "name another with --tracking-uri sqlite:///FILE"
        )
    database.parent.mkdir(parents=True, exist_ok=True)
    with database.with_name(f"{database.name}.lock").open("wb") as file:
        deadline = time.monotonic() + TURN_SECONDS
        while not _try_lock(file.fileno()):
            if time.monotonic() > deadline:
                raise TrackingError(f"another skillstitch kept it busy for {TURN_SECONDS:.0f} s")
            time.sleep(0.05)
        if database.exists():
            _check_unlocked(database)
        yield


def _try_lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _check_unlocked(database: Path) -> None:
    with closing(sqlite3.connect(database, timeout=LOCK_SECONDS)) as connection:
        try:
            connection.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as error:
            raise TrackingError(f"{error} (waited {LOCK_SECONDS:.0f} s)") from error


def connect(uri: str) -> MlflowClient:
    """A client of a tracking store, which is made where it is a file that is not there."""
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    from mlflow import MlflowClient

    # What they would say is in the outcome, in one line instead of a traceback.
    for logger in ("mlflow", "alembic", "urllib3"):
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    database = _database(uri)
    if database is not None and not database.exists():
        # A migration killed half-way cannot be resumed: the schema appears whole or not at all.
        draft = database.with_name(f"{database.name}.new")
        draft.unlink(missing_ok=True)
        MlflowClient(tracking_uri=f"sqlite:///{draft}").search_experiments(max_results=1)
        draft.rename(database)
    return MlflowClient(tracking_uri=uri)


def open_experiment(client: MlflowClient, uri: str, name: str) -> str:
    """The id of an experiment, which is made where there is none."""
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is None:
        database = _database(uri)
        folder = None if database is None else (database.parent.resolve() / "mlartifacts").as_uri()
        try:
            return client.create_experiment(name, artifact_location=folder)
        except MlflowException:  # another publisher to the same server was quicker
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage != "active":
        raise TrackingError(f"experiment {name} was deleted there: restore it or use another store")
    return found.experiment_id
