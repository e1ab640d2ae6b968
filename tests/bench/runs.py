"""Runs of the command line, and what a finished one says of itself."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pandas as pd


@dataclass(frozen=True)
class Run:
    """A finished run directory."""

    scale: str
    workers: int
    seconds: dict[str, float]  # of wall clock, by phase
    busy: dict[str, float]  # of all workers together, in training and in evaluation
    segments: int
    steps: int
    segments_without_tree: int
    steps_without_tree: int

    @property
    def working(self) -> float:
        """Wall seconds of training and simulation."""
        return self.seconds["training"] + self.seconds["evaluation"]

    @property
    def busy_workers(self) -> float:
        """How many workers were busy on average, meanwhile."""
        return sum(self.busy.values()) / self.working


def carry_out(folder: Path, *options: str) -> Run:
    """Table 1 in a process of its own, over a fresh store in `folder`."""
    where = ["--out", str(folder / "run"), "--store", str(folder / "store")]
    command = [sys.executable, "-m", "orchestrator.cli", "run", "table1", *where, *options]
    outcome = subprocess.run(command, capture_output=True, text=True)
    if outcome.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{outcome.stderr}")
    return read(folder / "run")


def read(directory: Path) -> Run:
    """What the last command that trained or simulated took; for a resumed run that is a part."""
    spec, provenance, seconds = (
        json.loads((directory / f"{name}.json").read_text())
        for name in ("spec", "provenance", "seconds")
    )
    counts = provenance["counts"]
    episodes = pd.read_parquet(directory / "episodes.parquet")
    # The accomplished skills, and the one that failed unless all are accomplished.
    segments = (episodes["accomplished"] + 1).clip(upper=episodes["length"])
    return Run(
        scale=spec["scale"],
        workers=provenance["workers"],
        seconds=provenance["seconds"] | seconds,
        busy=provenance["busy worker seconds"],
        segments=counts["segments played"],
        steps=counts["environment steps"],
        segments_without_tree=int(segments.sum()),
        steps_without_tree=counts["environment steps without the tree"],
    )
