"""Reports written again, and tables kept with the code.

Those of single runs need nothing that trains or simulates; suites are merged by their specs.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from analysis.report import build_report, export_results
from orchestrator.errors import said_to_users
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import storage_errors


def report_again(run: Path, results: Path | None, *, force: bool) -> Iterator[str]:
    """Write the report of a run or a suite from its segments; says what was written.

    results: also copy its tables, figures and report to RESULTS/<table>/. force: let them replace
    larger ones. Raises UsageError where there is no run, or where they would without it.
    """
    directory = RunDirectory(run)
    suite = directory.is_suite
    with directory.locked(), said_to_users():
        played = directory.played
        if suite:
            from orchestrator.storage.merge import merge_again

            merge_again(directory)
        if results is None:
            with storage_errors(run):
                build_report(run)
        else:  # builds it, too
            yield from _export(run, results, force)
        if played:
            directory.mark(finished=True)
    yield f"wrote {run / 'report' / 'index.html'}"


def export(run: Path, results: Path, *, force: bool) -> Iterator[str]:
    """Copy a finished run's tables, figures and report; as `report_again` does, without a merge."""
    with RunDirectory(run).locked(), said_to_users():
        yield from _export(run, results, force)


def _export(run: Path, results: Path, force: bool) -> Iterator[str]:
    with storage_errors(results):
        yield from (f"exported {folder}" for folder in export_results(run, results, force=force))
