"""What a folder holds: every run and sweep in it, a line each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from analysis.schema import QUARANTINE, SPEC
from orchestrator.errors import StorageError, UsageError
from orchestrator.storage.rundir import RunDirectory

STORE = "blocks.sqlite"
COPIES = "mlartifacts"  # MLflow's, of files of runs


def listing_lines(root: Path, sweep_state: Callable[[RunDirectory], str]) -> Iterator[str]:
    """Each run, suite and sweep below `root`: where, what, how far, and when it last went on.

    sweep_state: how far a sweep is, which only sweeps know.
    Raises UsageError where there is no such folder.
    """
    if not root.is_dir():
        raise UsageError(f"{root} is no folder; name the one that your runs are in")
    rows = [_row(folder, sweep_state) for folder in sorted(_run_folders(root))]
    if not rows:
        yield f"no run in {root}"
        return
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


def _run_folders(root: Path) -> Iterator[Path]:
    """Parts of a suite and the table of a sweep belong to it; what a store holds is no run."""
    for folder, below, files in os.walk(root):
        if SPEC in files:
            yield Path(folder)
        stays = SPEC not in files and STORE not in files
        below[:] = [name for name in below if stays and name != COPIES]


def _row(folder: Path, sweep_state: Callable[[RunDirectory], str]) -> tuple[str, str, str, str]:
    directory = RunDirectory(folder)
    try:
        sweep = directory.asked_sweep()
        asked = sweep or directory.asked()
        what = f"{asked['name']} at {asked['scale']} scale"
        state = sweep_state(directory) if sweep else _state(directory)
    except StorageError:
        what, state = "unreadable", "damaged: `skillstitch status` names the file"
    except KeyError:
        what, state = "unreadable", "its spec.json is damaged, or of another version"
    newest = max(path.stat().st_mtime for path in folder.iterdir())
    when = datetime.fromtimestamp(newest, UTC).strftime("%Y-%m-%d %H:%M UTC")
    return str(folder), what, state, when


def _state(directory: RunDirectory) -> str:
    if directory.played:
        return "finished"
    if given_up := directory.read_json(QUARANTINE):
        return f"{len(given_up)} blocks given up"
    if not (directory.path / "ledger.sqlite").is_file():
        return "unfinished"
    ledger = directory.ledger(read_only=True)
    blocks = len(ledger.finished())
    ledger.close()
    return f"unfinished, {blocks:,} blocks played"
