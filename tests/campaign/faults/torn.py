"""The ledger and a sweep's journal, torn at every byte of their last page."""

import shutil
import time
from contextlib import closing
from functools import cache
from pathlib import Path

from orchestrator.errors import IncompleteError, StorageError
from orchestrator.storage.ledger import Ledger
from orchestrator.work.evaluation import LARGEST_BUNDLE
from sweeps.journal import JOURNAL, repair
from tests.campaign.ground import Fault, Ground
from tests.orchestrator.launched import in_a_process, run_serially
from tests.orchestrator.tiny import Place, blocks_played
from tests.sweeps.tiny import promised, sweep_in, tiny_sweep

LEDGER = "ledger.sqlite"
LOG = f"{LEDGER}-wal"
PAGE = 4096
FRAME = PAGE + 24  # of a write-ahead log: a page and its header
RESUMED_EVERY = 256  # bytes: elsewhere only what is left is looked at


def log_of_the_ledger(ground: Ground, trial: int) -> str:
    """As a power cut leaves it: what was appended last ends anywhere.

    Of what was there, no more is lost than one record: a bundle of blocks.
    """
    killed, blocks = _killed_at_work(ground)
    done = _torn(ground, killed, LOG, trial)
    assert int(done.split(": ")[1].split()[0]) >= blocks - LARGEST_BUNDLE
    return done


def ledger(ground: Ground, trial: int) -> str:
    """The file itself, which SQLite does not leave so; a file system may."""
    return _torn(ground, ground.undisturbed, LEDGER, trial)


def journal(ground: Ground, trial: int) -> str:
    """Of a sweep that has ended, so that it goes on from wherever it is torn."""
    finished, root = _finished_sweep(ground), ground.folder()
    whole = (finished / "sweep" / JOURNAL).read_bytes()
    if trial % RESUMED_EVERY == 0:
        shutil.copytree(finished, root)
    path = root / "sweep" / JOURNAL
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(whole[: -trial - 1])
    repair(path)
    left = path.read_bytes()
    assert whole.startswith(left)
    assert left.endswith(b"\n")
    if trial % RESUMED_EVERY == 0:
        sweep_in(root, tiny_sweep())
        assert promised(root, tiny_sweep()) == promised(finished, tiny_sweep())
    shutil.rmtree(root)
    lines = left.count(b"\n")
    return f"{trial + 1} bytes missing: {lines} of {whole.count(bytes([10]))} lines left"


def _torn(ground: Ground, before: Place, name: str, trial: int) -> str:
    """Look into a ledger that misses so many bytes more than none; go on with it now and then."""
    place = ground.done() if trial % RESUMED_EVERY == 0 else ground.fresh()
    place.out.mkdir(parents=True, exist_ok=True)
    for file in before.out.glob(f"{LEDGER}*"):
        shutil.copy(file, place.out)
    with (place.out / name).open("r+b") as opened:
        opened.truncate((before.out / name).stat().st_size - trial - 1)
    left = _looked_into(ground, place.out / LEDGER)
    if "move it away and run the same command again" in left:
        for file in place.out.glob(f"{LEDGER}*"):
            file.unlink()
    else:
        assert left.endswith("blocks left")
    if trial % RESUMED_EVERY == 0:
        place.directory.mark(finished=False)
        ground.resume(place)
    shutil.rmtree(place.root)
    return f"{trial + 1} bytes missing: {left}"


def _looked_into(ground: Ground, path: Path) -> str:
    """How many blocks it has, or what is said of it. A block that is damaged is removed."""
    for _ in range(20):
        try:
            with closing(Ledger(path)) as torn:
                return f"{ground.check_blocks(torn)} blocks left"
        except StorageError as error:
            return str(error)
        except IncompleteError as error:
            if "the same command plays it again" not in str(error):
                raise
    raise AssertionError(f"{path}: block after block is said to be damaged")


@cache
def _killed_at_work(ground: Ground) -> tuple[Place, int]:
    """A run that SIGKILL has ended while it played: its ledger has a log. And how many blocks."""
    for _ in range(20):
        place = ground.trained()
        process = in_a_process(run_serially, place)
        while process.exitcode is None and blocks_played(place.out) < 40:
            time.sleep(0.01)
        process.kill()
        process.join()
        log = place.out / LOG
        if log.is_file() and log.stat().st_size > FRAME:
            copy = place.copied(ground.folder())  # to look into it ends the log
            return place, blocks_played(copy.out)
    raise AssertionError("no kill has left a log")


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
    Fault("ledger torn, at every byte of its last page", ledger, PAGE, tested=(0, 1000)),
    Fault(
        "journal of a sweep torn, at every byte of its last page", journal, PAGE, tested=(0, 1000)
    ),
)
