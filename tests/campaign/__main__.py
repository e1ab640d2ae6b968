"""`make campaign`: a run is harmed in every way we know of, some thousand times, and must survive.

    python -m tests.campaign [--only TEXT] [--say]

After each harm the same command is given again. Then the tables must be equal, to the byte, to
those of a run that nobody disturbed, and nothing may be there twice or be missing. What is random
is decided by the number of the trial alone, so a trial that fails can be tried again.
"""

from __future__ import annotations

import sys
import time
import traceback
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro

from orchestrator.work.worker import use_one_thread
from tests.campaign.faults import FAULTS
from tests.campaign.ground import Fault, Ground, NotTriedError

MOST_FAILURES = 5  # of a fault: the others would tell no more


def main(only: str = "", say: bool = False) -> None:
    """Try every fault, and print how many trials were survived.

    Args:
        only: faults whose names contain this.
        say: print every trial.
    """
    chosen = [fault for fault in FAULTS if only in fault.name]
    if not chosen:
        sys.exit(f"no fault is called {only!r}: " + "; ".join(fault.name for fault in FAULTS))
    use_one_thread()
    began = time.monotonic()
    with TemporaryDirectory(prefix="campaign-") as folder:
        ground = Ground(Path(folder))
        print(f"{'fault':<60} tried survived seconds")
        counts = [attempt(ground, fault, say) for fault in chosen]
    tried, survived = (sum(column) for column in zip(*counts, strict=True))
    minutes = (time.monotonic() - began) / 60
    print(f"{survived:,} of {tried:,} faults survived, in {minutes:.1f} minutes")
    sys.exit(tried != survived)


def attempt(ground: Ground, fault: Fault, say: bool) -> tuple[int, int]:
    """Do all trials of a fault; returns how many were tried and survived."""
    began, tried, survived = time.monotonic(), 0, 0
    for trial in range(fault.trials):
        if tried - survived == MOST_FAILURES:
            print(f"  {fault.name}: the other trials were left out")
            break
        try:
            done = fault.harm(ground, trial)
        except NotTriedError as error:
            print(f"{fault.name}: not tried, {error}")
            break
        except Exception:
            done = "NOT SURVIVED\n" + traceback.format_exc()
        else:
            survived += 1
        tried += 1
        if say or (survived < tried and done.startswith("NOT")):
            print(f"  {fault.name}, trial {trial}: {done}", flush=True)
    seconds = time.monotonic() - began
    print(f"{fault.name:<60} {tried:>5} {survived:>8} {seconds:>7.0f}", flush=True)
    return tried, survived


if __name__ == "__main__":
    tyro.cli(main)
