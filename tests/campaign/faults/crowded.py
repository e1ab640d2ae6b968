"""Too little of what a run needs: room on the disk, memory, a store and a clock of its own."""

import os
import resource
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from orchestrator.errors import LockedError, StorageError, UsageError
from orchestrator.storage.gc import collect_garbage
from tests.campaign.ground import Fault, Ground, NotTriedError, randomness
from tests.orchestrator.launched import in_a_process, run_serially
from tests.orchestrator.tiny import Place

DAY = 24 * 3600
SECONDS_TO_END = 30


def full_disk(ground: Ground, trial: int) -> str:
    """It fills up at another write in each trial; then there is room again."""
    needed = sum(path.stat().st_size for path in ground.undisturbed.root.rglob("*"))
    room = int(randomness("full disk", trial).uniform(0, needed))
    with _small_disk(ground.fresh().root, 4 * needed) as disk:
        place, ballast = Place(disk), disk / "ballast"
        ballast.write_bytes(bytes(shutil.disk_usage(disk).free - room))
        try:
            place.carry_out(ground.spec)
            said = "there was room enough"
        except StorageError as error:
            said = str(error)
        ballast.unlink()
        ground.resume(place)
    assert "there was room" in said or "make room and run the same command again" in said
    return f"{room} bytes of room: {said}"


@contextmanager
def _small_disk(folder: Path, size: int) -> Iterator[Path]:
    folder.mkdir()
    if shutil.which("mount") is None:
        raise NotTriedError("there is no mount to make a small disk with")
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if os.getuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        raise NotTriedError("only root can mount a small disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def little_memory(ground: Ground, trial: int) -> str:
    """The address space ends so many MB above what the libraries take."""
    megabytes = randomness("little memory", trial).uniform(0, 150)
    place = ground.fresh()
    process = in_a_process(_run_in, place, int(megabytes * 1e6))
    process.join(SECONDS_TO_END)
    if process.exitcode is None:  # a library's thread could not start, and others wait for it
        process.kill()
        process.join()
    ground.resume(place)
    return f"{megabytes:.0f} MB: exit {process.exitcode}"


def _run_in(place: Place, bytes_more: int) -> None:
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + bytes_more, hard))
    run_serially(place)


def one_store(ground: Ground, trial: int) -> str:
    """Two runs share it, one of them is killed and begun again, and all the while a gc deletes."""
    rng = randomness("one store", trial)
    first, root = ground.fresh(), ground.fresh().root
    second = _Beside(root, first.store_root)
    moment = rng.uniform(0, 0.8 * ground.seconds)
    runs = [in_a_process(run_serially, place) for place in (first, second)]
    killed, began, collected = int(rng.integers(2)), time.monotonic(), 0
    while any(process.exitcode is None for process in runs):
        collected += _collect(first, second)
        time.sleep(0.02)
        if time.monotonic() - began > moment and runs[killed].exitcode is None:
            runs[killed].kill()
            runs[killed].join()
            runs[killed] = in_a_process(run_serially, (first, second)[killed])
            moment = float("inf")
    assert [process.exitcode for process in runs] == [0, 0]
    for place in (first, second):
        ground.check(place)
    assert _collect(first, second)
    for place in (first, second):
        ground.resume(place)
    return f"{collected} collections beside two runs"


@dataclass(frozen=True)
class _Beside(Place):
    """A run directory over another's store."""

    elsewhere: Path

    @property
    def store_root(self) -> Path:
        return self.elsewhere


def _collect(*places: Place) -> bool:
    """Whether a collection went through."""
    runs = [place.out for place in places]
    with suppress(LockedError, UsageError):  # one is at work; or has not begun
        list(collect_garbage(places[0].store_root, runs, delete=True))
        return True
    return False


def clock_set_back(ground: Ground, trial: int) -> str:
    """By a day, between a kill and the next command: all that is there is of tomorrow."""
    moment = randomness("clock", trial).uniform(0, ground.seconds)
    place = ground.fresh()
    process = in_a_process(run_serially, place)
    process.join(moment)
    process.kill()
    process.join()
    for path in place.root.rglob("*"):
        os.utime(path, (time.time() + DAY, time.time() + DAY))
    _collect(place)
    with mock.patch("time.time", side_effect=_yesterday):
        ground.resume(place)
        _collect(place)
        ground.resume(place)
    return f"after {moment:.2f} s of a run"


_now = time.time


def _yesterday() -> float:
    return _now() - DAY


FAULTS = (
    Fault("a disk that is full at any write", full_disk, 40),
    Fault("little memory", little_memory, 15),
    Fault("two runs and a gc over one store, a run killed", one_store, 15),
    Fault("the clock set back a day after a kill", clock_set_back, 15),
)
