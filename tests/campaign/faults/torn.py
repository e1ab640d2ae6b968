"""The ledger and a sweep's journal, torn at every byte of their last page."""

import shutil
from functools import cache
from pathlib import Path

from orchestrator.errors import StorageError
from orchestrator.storage.ledger import Ledger
from sweeps.journal import JOURNAL
from sweeps.study import SweepStudy
from tests.campaign.ground import Fault, Ground
from tests.orchestrator.launched import in_a_process, run_serially
from tests.orchestrator.tiny import Place, blocks_played
from tests.sweeps.tiny import promised, sweep_in, tiny_sweep

PAGE = 4096
FRAME = PAGE + 24  # of a write-ahead log: a page and its header
RESUMED_EVERY = 256  # bytes: elsewhere only what is left is looked at


def log_of_the_ledger(ground: Ground, trial: int) -> str:
    """As a power cut leaves it: what was appended last ends anywhere."""
    place = ground.done()
    killed = _killed_at_work(ground)
    shutil.rmtree(place.out)
    shutil.copytree(killed.out, place.out)
    log = place.out / "ledger.sqlite-wal"
    _tear(log, trial)
    return _look_and_resume(ground, place, trial)


def ledger(ground: Ground, trial: int) -> str:
    """The file itself, which SQLite does not leave so; a file system may."""
    place = ground.done()
    _tear(place.out / "ledger.sqlite", trial)
    return _look_and_resume(ground, place, trial)


def journal(ground: Ground, trial: int) -> str:
    """Of a sweep that has ended, so that it goes on from wherever it is torn."""
    root = ground.fresh().root
    shutil.copytree(_finished_sweep(ground), root)
    _tear(root / "sweep" / JOURNAL, trial)
    sweep = tiny_sweep()
    left = len(SweepStudy(sweep, root / "sweep").trials)
    if trial % RESUMED_EVERY == 0:
        sweep_in(root, sweep)
        assert promised(root, sweep) == promised(_finished_sweep(ground), sweep)
    shutil.rmtree(root)
    return f"{trial} bytes missing: {left} trials left"


def _tear(file: Path, missing: int) -> None:
    with file.open("r+b") as opened:
        opened.truncate(max(file.stat().st_size - missing - 1, 0))


def _look_and_resume(ground: Ground, place: Place, trial: int) -> str:
    path = place.out / "ledger.sqlite"
    try:
        torn = Ledger(path)
        left = f"{ground.check_blocks(torn)} blocks left"
        torn.close()
    except StorageError as error:
        left = str(error)
        for file in place.out.glob("ledger.sqlite*"):
            file.unlink()
    assert "blocks left" in left or "move it away and run the same command again" in left
    if trial % RESUMED_EVERY == 0:
        ground.resume(place)
    shutil.rmtree(place.root)
    return f"{trial} bytes missing: {left}"


@cache
def _killed_at_work(ground: Ground) -> Place:
    """A run that SIGKILL has ended while it played: its ledger has a log."""
    while True:
        place = ground.trained()
        process = in_a_process(run_serially, place)
        while process.exitcode is None and blocks_played(place.out) < 40:
            pass
        process.kill()
        process.join()
        log = place.out / "ledger.sqlite-wal"
        if log.is_file() and log.stat().st_size > FRAME:
            return place


@cache
def _finished_sweep(ground: Ground) -> Path:
    place = ground.trained()
    sweep_in(place.root, tiny_sweep())
    return place.root


FAULTS = (
    Fault(
        "log of the ledger torn, at every byte of its last page",
        log_of_the_ledger,
        FRAME,
        tested=(0, 1000),
    ),
    Fault("ledger torn, at every byte of its last page", ledger, PAGE, (0, 1000)),
    Fault("journal of a sweep torn, at every byte of its last page", journal, PAGE, (0, 1000)),
)
