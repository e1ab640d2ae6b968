"""Killed at any moment, a run resumes to the bytes of one that nobody disturbed.

A few kills of each kind by default; SKILLSTITCH_KILLS=10 asks for ten seeds of each.
"""

import multiprocessing
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import TERMINATED
from orchestrator.spec.spec import Spec
from tests.orchestrator.executors.processes import descendants, title, titled
from tests.orchestrator.tiny import (
    TINY,
    Place,
    blocks_played,
    carry_out,
    promised_bytes,
    serially,
    tiny_spec,
)

SEEDS = range(int(os.environ.get("SKILLSTITCH_KILLS", "3")))
KILLS_IN_A_ROW = 3


def _start_nothing() -> None:
    pass


def _carry_out(place: Place) -> None:
    place.carry_out(tiny_spec())


def _carry_out_tracked(place: Place) -> None:
    settings = replace(serially(place.out, place.store_root), tracking_uri=None)
    carry_out(tiny_spec(), settings)


def in_a_process(target: Callable[..., None], *arguments: Place) -> BaseProcess:
    """From a server that has imported everything, so that kills hit the run and not its start."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.orchestrator.tiny", "matplotlib.pyplot"])
    process = context.Process(target=target, args=arguments)
    process.start()
    return process


def check_undisturbed(place: Place, expected: dict[str, bytes]) -> None:
    """What was killed or interrupted, and then finished, is as if nothing had happened."""
    assert promised_bytes(place.out) == expected
    assert place.directory.finished
    assert place.directory.read_json("quarantine.json") == []


@pytest.fixture(scope="module")
def duration(tmp_path_factory: pytest.TempPathFactory) -> float:
    """Seconds of an undisturbed run in a process, once the server is there."""
    in_a_process(_start_nothing).join()
    started = time.monotonic()
    process = in_a_process(_carry_out, Place(tmp_path_factory.mktemp("undisturbed")))
    process.join()
    assert process.exitcode == 0
    return time.monotonic() - started


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_the_serial_driver_is_killed(
    place: Place, expected: dict[str, bytes], duration: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    for moment in rng.uniform(0, duration, KILLS_IN_A_ROW):
        process = in_a_process(_carry_out, place)
        process.join(moment)
        process.kill()
        process.join()
        assert process.exitcode in (-signal.SIGKILL, 0)
    place.carry_out(tiny_spec())
    check_undisturbed(place, expected)


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


@pytest.mark.slow
def test_mlflow_shows_nothing_running_after_a_kill(place: Place, spec: Spec) -> None:
    process = in_a_process(_carry_out_tracked, place)
    while process.exitcode is None and "RUNNING" not in statuses(place):
        time.sleep(0.01)
    process.kill()
    process.join()
    assert "RUNNING" in statuses(place)

    process = in_a_process(_carry_out_tracked, place)
    process.join()
    assert process.exitcode == 0
    assert place.directory.finished
    assert statuses(place) == ["FINISHED"] * (1 + len(spec.methods) * spec.seeds)


@pytest.fixture
def cleared() -> Iterator[list[int]]:
    """Processes to be ended after the test: some of Ray's outlive what they belong to."""
    processes: list[int] = []
    yield processes
    for process in processes:
        if "ray" in title(process):
            os.kill(process, signal.SIGKILL)


def launch(place: Place) -> subprocess.Popen[bytes]:
    options = ["--workers", "2", "--tracking-uri", "none"]
    paths = ["--out", str(place.out), "--store", str(place.store_root)]
    command = [sys.executable, "-m", "orchestrator.cli", "run", str(TINY), *options, *paths]
    place.root.mkdir(parents=True, exist_ok=True)
    with errors_of(place).open("wb") as errors:
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors)


def errors_of(place: Place) -> Path:
    return place.root / "errors"


def artifacts_built(place: Place) -> int:
    return len(list(place.store.artifacts()))


def raylets(driver: int) -> list[int]:
    return titled(driver, "raylet/raylet")


def workers(driver: int) -> list[int]:
    return titled(driver, "ray::_")  # those that train and those that play; agents are ray::Agent


VICTIMS: tuple[Callable[[int], list[int]], ...] = (lambda driver: [driver], workers, raylets)


@pytest.mark.ray
@pytest.mark.slow
@pytest.mark.timeout(240)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_process_of_a_ray_run_is_killed(
    spec: Spec, place: Place, expected: dict[str, bytes], cleared: list[int], seed: int
) -> None:
    """The driver, one of its workers, or the raylet, by turns, at a random point of the work."""
    rng = np.random.default_rng(seed)
    victims = VICTIMS[seed % len(VICTIMS)]
    if rng.random() < 0.4:
        progress, aim = artifacts_built, int(rng.integers(8))
    else:
        progress, aim = lambda place: blocks_played(place.out), int(rng.integers(1, 80))

    run = launch(place)
    while run.poll() is None and (progress(place) < aim or not victims(run.pid)):
        time.sleep(0.01)
    time.sleep(rng.uniform(0, 0.2))
    cleared += descendants(run.pid)
    unlucky = rng.permutation(victims(run.pid))
    if len(unlucky):  # else it has come to its end meanwhile
        os.kill(int(unlucky[0]), signal.SIGKILL)
    code = run.wait(180)

    if victims is workers:
        assert code == 0  # the driver sees to it that the work is done again
    else:
        place.carry_out(spec)
    check_undisturbed(place, expected)


# SIGTERM of the driver: when Ray has begun to start, while it trains, and while it plays.
MOMENTS: dict[str, Callable[[Place, int], bool]] = {
    "starting": lambda place, driver: bool(titled(driver, "gcs_server")),
    "training": lambda place, driver: artifacts_built(place) >= 2,
    "playing": lambda place, driver: blocks_played(place.out) >= 3,
}


@pytest.mark.ray
@pytest.mark.slow
@pytest.mark.timeout(240)
@pytest.mark.parametrize("moment", MOMENTS)
def test_sigterm_ends_a_ray_run_as_ctrl_c_does(
    spec: Spec, place: Place, expected: dict[str, bytes], cleared: list[int], moment: str
) -> None:
    run = launch(place)
    while run.poll() is None and not MOMENTS[moment](place, run.pid):
        time.sleep(0.01)
    processes = descendants(run.pid)
    cleared += processes
    run.terminate()
    assert run.wait(60) == TERMINATED
    *progress, last = errors_of(place).read_text().splitlines()
    assert last == "interrupted; the same command resumes"
    assert all(line.startswith(("training: ", "evaluation: ")) for line in progress), progress
    deadline = time.monotonic() + 30
    while any("ray" in title(process) for process in processes):
        assert time.monotonic() < deadline, [title(process) for process in processes]
        time.sleep(0.1)

    place.carry_out(spec)
    check_undisturbed(place, expected)


def test_the_victims_are_found(tmp_path: Path) -> None:
    """A search that finds nobody would kill nobody."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)", "ray::_test"])
    try:
        deadline = time.monotonic() + 10
        while process.pid not in workers(os.getpid()):
            assert time.monotonic() < deadline
        assert process.pid in descendants(os.getpid())
    finally:
        process.kill()
        process.wait()
