"""The undisturbed run, copies of it to harm, and what each must be in the end."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from orchestrator.storage.ledger import Ledger
from stitching.streams import stream
from tests.orchestrator.launched import in_a_process, run_serially, start_nothing
from tests.orchestrator.tiny import Place, promised_bytes, tiny_spec


class NotTriedError(Exception):
    """This machine does not allow the fault; says what it would take."""


@dataclass(frozen=True)
class Fault:
    """One kind of harm. `harm` does one trial of it, from the harm to what must hold in the end.

    It takes the number of the trial, which decides all that is random, and returns what was done.
    It raises AssertionError where that was not survived, and NotTriedError.
    """

    name: str
    harm: Callable[[Ground, int], str]
    trials: int  # in the campaign
    tested: tuple[int, ...] = (0,)  # the trials that `make test` does as well
    needs_ray: bool = False


class Ground:
    """Where faults are tried. What a trial has left is not looked at by the next."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.spec = tiny_spec()
        self.undisturbed = Place(root / "undisturbed")
        self.undisturbed.carry_out(self.spec)
        self.expected = promised_bytes(self.undisturbed.out)
        self._numbers = itertools.count()

    def folder(self) -> Path:
        """The name of one that is not there yet."""
        return self.root / str(next(self._numbers))

    def fresh(self) -> Place:
        """Nothing there yet."""
        return Place(self.folder())

    def trained(self) -> Place:
        """Every artifact is there, nothing is played."""
        return self.undisturbed.trained(self.folder())

    def done(self) -> Place:
        """All that the undisturbed run has left."""
        return self.undisturbed.copied(self.folder())

    @cached_property
    def outcomes(self) -> dict[str, bytes]:
        """Every block of the undisturbed run."""
        ledger = self.undisturbed.directory.ledger(read_only=True)
        blocks = dict(ledger.raw(sorted(ledger.finished())))
        ledger.close()
        return blocks

    @cached_property
    def seconds(self) -> float:
        """How long an undisturbed run takes in a process."""
        in_a_process(start_nothing).join()
        began = time.monotonic()
        process = in_a_process(run_serially, self.fresh())
        process.join()
        assert process.exitcode == 0
        return time.monotonic() - began

    def resume(self, place: Place) -> None:
        """The same command again; then all is as if nothing had happened."""
        place.carry_out(self.spec)
        self.check(place)

    def check(self, place: Place) -> None:
        """The tables are equal to the byte, nothing is there twice, and nothing is lost."""
        self.check_tables(place)
        assert place.finished_blocks() == set(self.outcomes)

    def check_tables(self, place: Place) -> None:
        """All that is made of the ledger is there, as it should be."""
        assert promised_bytes(place.out) == self.expected
        assert place.directory.finished
        assert place.directory.read_json("quarantine.json") == []

    def check_blocks(self, ledger: Ledger) -> int:
        """What a harmed ledger still has is what was recorded; returns how many blocks."""
        blocks = dict(ledger.raw(sorted(ledger.finished())))
        assert blocks.items() <= self.outcomes.items()
        return len(blocks)


def randomness(name: str, trial: int) -> np.random.Generator:
    """The same for the same trial of the same fault, whatever else is tried."""
    return stream("campaign", name, trial)
