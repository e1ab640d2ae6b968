"""What a run leaves behind that is killed or ended; tests/campaign has faults of every kind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from orchestrator.cli import TERMINATED
from orchestrator.spec.spec import Spec
from tests.orchestrator.executors.processes import descendants, title, titled
from tests.orchestrator.launched import (
    artifacts_built,
    errors_of,
    in_a_process,
    launch,
    run_tracked,
    statuses,
    workers,
)
from tests.orchestrator.tiny import Place, blocks_played, promised_bytes


def check_undisturbed(place: Place, expected: dict[str, bytes]) -> None:
    """What was killed or interrupted, and then finished, is as if nothing had happened."""
    assert promised_bytes(place.out) == expected
    assert place.directory.finished
    assert place.directory.read_json("quarantine.json") == []


@pytest.mark.slow
def test_mlflow_shows_nothing_running_after_a_kill(place: Place, spec: Spec) -> None:
    process = in_a_process(run_tracked, place)
    while process.exitcode is None and "RUNNING" not in statuses(place):
        time.sleep(0.01)
    process.kill()
    process.join()
    assert "RUNNING" in statuses(place)

    process = in_a_process(run_tracked, place)
    process.join()
    assert process.exitcode == 0
    assert place.directory.finished
    assert statuses(place) == ["FINISHED"] * (1 + len(spec.methods) * spec.seeds)


@pytest.mark.slow
def test_mlflow_shows_what_sigterm_ended_as_killed_until_it_goes_on(place: Place) -> None:
    def shown_running(run: subprocess.Popen[bytes]) -> bool:
        while run.poll() is None and "RUNNING" not in statuses(place):
            time.sleep(0.01)
        return "RUNNING" in statuses(place)

    long = ("--executor", "serial", "--agent.updates", "2000", "--seeds", "1")
    run = launch(place, *long)
    assert shown_running(run)
    run.terminate()
    assert run.wait(60) == TERMINATED
    assert errors_of(place).read_text().splitlines()[-1] == "interrupted; the same command resumes"
    assert set(statuses(place)) == {"KILLED"}

    run = launch(place, *long)
    assert shown_running(run)
    assert run.wait(120) == 0
    assert set(statuses(place)) == {"FINISHED"}


@pytest.fixture
def cleared() -> Iterator[list[int]]:
    """Processes to be ended after the test: some of Ray's outlive what they belong to."""
    processes: list[int] = []
    yield processes
    for process in processes:
        if "ray" in title(process):
            os.kill(process, signal.SIGKILL)


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
    kinds = ("preparing", "checking what is there", "starting workers", "training", "evaluation")
    assert all(line.partition(":")[0] in kinds for line in progress), progress
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
