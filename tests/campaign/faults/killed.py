"""SIGKILL, SIGTERM and SIGSTOP of the driver, of a worker and of Ray's raylet, at any moment."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial

import numpy as np

from orchestrator.cli import TERMINATED
from orchestrator.errors import IncompleteError
from tests.campaign.ground import Fault, Ground, randomness
from tests.orchestrator.executors.processes import descendants, title
from tests.orchestrator.launched import (
    artifacts_built,
    errors_of,
    in_a_process,
    launch,
    raylets,
    run_serially,
    workers,
)
from tests.orchestrator.tiny import Place, blocks_played

KILLS_IN_A_ROW = 3
SECONDS_STOPPED = 4
ENDED_BY_RAY = 1  # which ends the driver, too, when its raylet is gone for good
VICTIMS: dict[str, Callable[[int], list[int]]] = {
    "the driver": lambda driver: [driver],
    "a worker": workers,
    "the raylet": raylets,
}


def serial_driver(ground: Ground, trial: int) -> str:
    """Three times in a row, then left in peace."""
    moments = randomness("serial driver", trial).uniform(0, ground.seconds, KILLS_IN_A_ROW)
    place = ground.fresh()
    for moment in moments:
        process = in_a_process(run_serially, place)
        process.join(moment)
        process.kill()
        process.join()
        assert process.exitcode in (-signal.SIGKILL, 0)
    ground.resume(place)
    return f"killed after {', '.join(f'{moment:.2f}' for moment in moments)} s"


def of_a_ray_run(how: signal.Signals, victim: str, ground: Ground, trial: int) -> str:
    """Once, at a point of the training or of the evaluation."""
    rng = randomness(f"{how.name} {victim}", trial)
    place = ground.fresh()
    with _launched(place) as (driver, processes):
        progress, aim = _point(place, rng)
        while driver.poll() is None and (progress() < aim or not VICTIMS[victim](driver.pid)):
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.2))
        processes += descendants(driver.pid)
        unlucky = rng.permutation(VICTIMS[victim](driver.pid))
        reached = f"{artifacts_built(place)} artifacts, {blocks_played(place.out)} blocks"
        if len(unlucky):  # else it has come to its end meanwhile
            _signal(int(unlucky[0]), how)
        if how == signal.SIGSTOP and len(unlucky):
            time.sleep(SECONDS_STOPPED)
            _signal(int(unlucky[0]), signal.SIGCONT)
        code = driver.wait(180)
    said = errors_of(place).read_text()
    assert code in _expected(how, victim), (code, said)
    assert "Traceback" not in said
    if code == 0:
        ground.check(place)
    ground.resume(place)
    return f"{how.name} to {victim} at {reached}: exit {code}"


def _point(place: Place, rng: np.random.Generator) -> tuple[Callable[[], int], int]:
    """What counts the progress of the run, and the count at which it is hit."""
    if rng.random() < 0.4:
        return lambda: artifacts_built(place), int(rng.integers(8))
    return lambda: blocks_played(place.out), int(rng.integers(1, 80))


def _expected(how: signal.Signals, victim: str) -> set[int]:
    """Exit codes of the run; 0 is always among them, for it may have ended before."""
    if how == signal.SIGSTOP or victim == "a worker":
        return {0}  # whoever was stopped goes on; what a worker held is sent again
    if victim == "the driver":
        return {0, TERMINATED if how == signal.SIGTERM else -how}
    return {0, IncompleteError.exit_code, ENDED_BY_RAY}


def _signal(process: int, how: signal.Signals) -> None:
    with suppress(ProcessLookupError):  # it has just ended
        os.kill(process, how)


@contextmanager
def _launched(place: Place) -> Iterator[tuple[subprocess.Popen[bytes], list[int]]]:
    """A run on Ray, and a list to be filled with its processes: some of Ray's outlive it."""
    driver, processes = launch(place), list[int]()
    try:
        yield driver, processes
    finally:
        driver.kill()
        driver.wait()
        for process in processes:
            if "ray" in title(process):
                _signal(process, signal.SIGKILL)


FAULTS = (
    Fault("SIGKILL of the serial driver, three in a row", serial_driver, 20, tested=(0, 1)),
    *(
        Fault(
            f"{how.name} of {victim} on Ray",
            partial(of_a_ray_run, how, victim),
            trials=3,
            tested=(0,) if how == signal.SIGKILL else (),
            needs_ray=True,
        )
        for how in (signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP)
        for victim in VICTIMS
    ),
)
