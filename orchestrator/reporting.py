"""Reports written again, and tables kept with the code; needs nothing that trains or simulates."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from analysis.report import build_report, export_results
from orchestrator.errors import said_to_users
from orchestrator.storage.rundir import RunDirectory


def report_again(run: Path, results: Path | None, *, force: bool) -> Iterator[str]:
    """Write the report of a run or a suite from its segments; says what was written.

    results, force: as of `export`. UsageError where there is no run.
    """
    directory = RunDirectory(run)
    suite = directory.is_suite
    with directory.locked(), said_to_users():
        if suite:
            from orchestrator.storage.merge import merge_again

            merge_again(directory)
        if results is None:
            build_report(run)
    if results is not None:  # builds it, too
        yield from export(run, results, force=force)
    yield f"wrote {run / 'report' / 'index.html'}"


def export(run: Path, results: Path, *, force: bool) -> Iterator[str]:
    """Copy a run's tables, figures and report to RESULTS/<table>/; says where to.

    force: let them replace larger ones. Raises RunError where they would without it.
    """
    with RunDirectory(run).locked(), said_to_users():
        folders = export_results(run, results, force=force)
    for folder in folders:
        yield f"exported {folder}"
