"""Runs in processes of their own, to be stopped, ended and killed."""

import multiprocessing
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from tests.orchestrator.executors.processes import titled
from tests.orchestrator.tiny import TINY, Place, carry_out, serially, tiny_spec


def in_a_process(target: Callable[..., None], *arguments: Any) -> BaseProcess:
    """From a server that has imported everything, so that kills hit the run and not its start."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.orchestrator.launched", "matplotlib.pyplot"])
    process = context.Process(target=target, args=arguments)
    process.start()
    return process


def start_nothing() -> None:
    """To have the server of processes there."""


def run_serially(place: Place) -> None:
    """The tiny run, by the serial executor, without MLflow."""
    place.carry_out(tiny_spec())


def run_tracked(place: Place) -> None:
    """The same, with an MLflow store beside the run directory."""
    settings = replace(serially(place.out, place.store_root), tracking_uri=None)
    carry_out(tiny_spec(), settings)


def launch(place: Place, *options: str) -> subprocess.Popen[bytes]:
    """The real command; by itself on two workers of a Ray of its own, without MLflow."""
    options = options or ("--workers", "2", "--tracking-uri", "none")
    paths = ["--out", str(place.out), "--store", str(place.store_root)]
    command = [sys.executable, "-m", "orchestrator.cli", "run", str(TINY), *options, *paths]
    place.root.mkdir(parents=True, exist_ok=True)
    with errors_of(place).open("wb") as errors:
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors)


def errors_of(place: Place) -> Path:
    """What a launched run has said."""
    return place.root / "errors"


def artifacts_built(place: Place) -> int:
    return len(list(place.store.artifacts()))


def raylets(driver: int) -> list[int]:
    return titled(driver, "raylet/raylet")


def workers(driver: int) -> list[int]:
    return titled(driver, "ray::_")  # those that train and those that play; agents are ray::Agent


def statuses(place: Place) -> list[str]:
    """Of all MLflow runs, as its database has them."""
    database = place.root / "mlflow.db"
    if not database.is_file():
        return []
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True, timeout=30)) as db:
        try:
            return [status for (status,) in db.execute("SELECT status FROM runs")]
        except sqlite3.OperationalError:  # the file is there, its tables are not yet
            return []
