"""`skillstitch status`: how far a run or a suite is, from what lies in its directory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from analysis.schema import QUARANTINE
from orchestrator.storage.rundir import PLANNED, RunDirectory
from orchestrator.storage.store import Store


def status_lines(directory: RunDirectory, store_root: Path | None = None) -> Iterator[str]:
    """How far a run or a suite is: artifacts in a store (default: its own), blocks, its report.

    Raises UsageError where there is neither.
    """
    asked = directory.asked()
    yield f"{directory.path}: {asked['name']} at {asked['scale']} scale"
    if directory.is_suite:
        for label, part in directory.parts.items():
            if (part.path / "ledger.sqlite").is_file():
                yield f"  part       {label}"
                yield from (f"    {line}" for line in status_lines(part, store_root))
            else:
                yield f"  part       {label}: not begun"
    else:
        yield from _run_lines(directory, Store(store_root or directory.store_root))
    report = directory.path / "report" / "index.html"
    yield f"  report     {report if report.is_file() else 'not written yet'}"


def block_counts(directory: RunDirectory) -> tuple[int, int]:
    """How many blocks are played, and how many failed at least once."""
    ledger = directory.ledger(read_only=True)
    finished, failures = ledger.finished(), ledger.failures()
    ledger.close()
    return len(finished), len(failures)


def failure_lines(failed: int) -> Iterator[str]:
    if failed:
        yield f"  failures   {failed} blocks failed at least once"


def _run_lines(directory: RunDirectory, store: Store) -> Iterator[str]:
    played, failed = block_counts(directory)
    planned = directory.read_json(PLANNED)
    if planned is None:
        yield f"  blocks     {played} played; how many there will be is not known"
    else:
        artifacts = planned["artifacts"]
        built = sum((kind, key) in store for kind, key in artifacts)
        yield f"  artifacts  {built} of {len(artifacts)}"
        yield f"  blocks     {played} played of at most {planned['blocks']}"
    yield from failure_lines(failed)
    for entry in directory.read_json(QUARANTINE) or []:
        yield f"  given up   seed {entry['seed']}, {entry['method']}, {entry['prefix']}"
