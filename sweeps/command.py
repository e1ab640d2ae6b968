"""`skillstitch sweep SPEC`: what it takes, and what it prints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from analysis.results import check_results
from orchestrator.errors import UsageError, said_to_users
from orchestrator.executors import ExecutorKind
from orchestrator.reproduction import Settings
from orchestrator.spec.tomls import Scale
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import USUAL_STORE
from orchestrator.work.progress import ConsoleProgress
from sweeps.costs import plan_lines
from sweeps.results.report import results_names, summary
from sweeps.spec import load_sweep, packaged_sweeps
from sweeps.sweep import carry_out, default_out


@dataclass(frozen=True)
class SweepCommand:
    """Search over fields of a spec, or go on where it was interrupted; ends with its winner."""

    spec: tyro.conf.Positional[str]  # a packaged sweep's name, or a TOML file
    scale: Scale = "paper"
    trials: int | None = None  # another budget than the spec's; a finished study goes on with it
    out: Path | None = None  # sweep directory; default: runs/sweep-<name>-<scale>
    store: Path = USUAL_STORE  # where artifacts and finished blocks are kept
    executor: ExecutorKind = "ray"  # serial: everything in this process
    workers: int | None = None  # default: all cores, or all of the cluster's
    address: str | None = None  # of a Ray cluster to join
    dashboard: bool = False  # show Ray's dashboard, on this machine alone
    tracking_uri: str | None = None  # MLflow; default: SQLite beside the store; none: off
    results: Path | None = None  # also export: RESULTS/<table>/ of a grid, else RESULTS/<name>/
    force: bool = False  # let the exported tables replace larger ones
    plan: bool = False  # only say what there is already, and what a trial takes


def sweep(words: list[str], output: Console, errors: Console) -> None:
    """Parse, carry out, and print what was found."""
    if not words:
        raise UsageError(f"skillstitch sweep needs a sweep: {', '.join(packaged_sweeps())}")
    command = tyro.cli(
        SweepCommand,
        args=words,
        prog="skillstitch sweep",
        description=f"Packaged sweeps: {', '.join(packaged_sweeps())}.",
    )
    asked = load_sweep(command.spec, command.scale, command.trials)
    settings = Settings(
        command.out or default_out(asked),
        command.store,
        command.executor,
        command.workers,
        command.address,
        command.tracking_uri,
        command.dashboard,
    )
    if command.plan:
        for line in plan_lines(asked, command.store):
            output.print(line, markup=False)
        return
    if command.results is not None:
        with said_to_users():
            check_results(command.results, results_names(asked), asked.extent, command.force)
    with ConsoleProgress(errors) as progress, said_to_users():
        for line in plan_lines(asked, command.store):
            progress.say(line)
        directory = carry_out(
            asked, settings, progress, command.results, force=command.force, source=command.spec
        )
    for line in summary_lines(directory):
        output.print(line, markup=False)


def summary_lines(directory: RunDirectory) -> Iterator[str]:
    """What a sweep found, and where its report is."""
    report = directory.path / "report"
    yield summary((report / "index.md").read_text(encoding="utf-8"))
    yield ""
    yield f"report: {report / 'index.html'}"
