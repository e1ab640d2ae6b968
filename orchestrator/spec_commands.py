"""The commands that take a spec: its fields are their options."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from orchestrator.errors import IncompleteError, UsageError, said_to_users
from orchestrator.executors import ExecutorKind
from orchestrator.spec.options import HELP_ALL, MORE, basics_alone
from orchestrator.spec.spec import Spec
from orchestrator.spec.suite import Suite, load_asked, with_specs
from orchestrator.spec.tomls import packaged_specs
from orchestrator.storage.store import USUAL_STORE

HELP = {"-h", "--help", HELP_ALL}
OfSpec = Annotated[Spec, tyro.conf.arg(name="")]  # spec fields are options of the command itself


@dataclass(frozen=True)
class PlanCommand:
    """What a spec would train and simulate, and what that costs. Runs nothing."""

    spec: OfSpec
    store: Path = USUAL_STORE  # where artifacts and finished blocks are kept
    workers: int | None = None  # to estimate the time for; default: all cores
    address: str | None = None  # of a Ray cluster that they would be on; is not asked anything
    from_sweep: str | None = None  # take a finished sweep's winner: its name or directory


@dataclass(frozen=True)
class RunCommand:
    """Carry a spec out, or go on where it was interrupted; ends with tables and report."""

    spec: OfSpec
    out: Path | None = None  # run directory; default: runs/<name>-<scale>
    store: Path = USUAL_STORE  # where artifacts and finished blocks are kept
    executor: ExecutorKind = "ray"  # serial: everything in this process
    workers: int | None = None  # default: all cores, or all of the cluster's
    address: str | None = None  # of a Ray cluster to join, e.g. 10.0.0.1:6379 or auto
    dashboard: bool = False  # show Ray's dashboard, on this machine alone
    tracking_uri: str | None = None  # MLflow; default: SQLite beside the store; none: off
    results: Path | None = None  # also export each table to RESULTS/<table>/
    force: bool = False  # let the exported tables replace larger ones
    from_sweep: str | None = None  # take a finished sweep's winner: its name or directory


def _with_spec(command: type[Any], name: str, words: list[str]) -> tuple[Any, Spec | Suite]:
    """Parse `SPEC [options]`; every field of the spec is an option, its default the spec's own.

    The fields of a suite's parts differ: the same words are read for each of them.
    """
    program = f"skillstitch {name} SPEC"
    if not words or words[0].startswith("-"):
        if words and words[0] in HELP:
            words = [packaged_specs()[0], words[0]]
        else:
            raise UsageError(f"skillstitch {name} needs a spec: {', '.join(packaged_specs())}")
    scale: Any = _option(words, "--scale") or "paper"
    asked = load_asked(words[0], scale)
    specs = [part.spec for part in asked.parts] if isinstance(asked, Suite) else [asked]
    if sweep := _option(words, "--from-sweep"):
        from sweeps.winner import with_winner

        specs = [with_winner(spec, sweep) for spec in specs]
    commands = []
    for spec in specs:
        try:
            commands.append(_parsed(command(spec), words[1:], program))
        except SystemExit as end:
            if end.code and len(specs) > 1:
                raise UsageError(f"options apply to every part; so read for {spec.name}") from None
            raise
    if isinstance(asked, Suite):
        return commands[0], with_specs(asked, [each.spec for each in commands])
    return commands[0], commands[0].spec


def _parsed(default: Any, words: list[str], program: str) -> Any:
    """A command's options, read over its defaults; help says the basics, or all where asked to."""
    command, more = type(default), ""
    with ExitStack() as stack:
        if HELP_ALL in words:
            words = ["--help"]
        elif not HELP.isdisjoint(words):
            stack.enter_context(basics_alone(default.spec))
            more = MORE
        description = f"{command.__doc__} {more}"
        return tyro.cli(command, default=default, args=words, prog=program, description=description)


def _option(words: list[str], name: str) -> str:
    """The value of an option that decides the defaults of all others."""
    value = ""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == name:
            value = following
        elif word.startswith(f"{name}="):
            value = word.partition("=")[2]
    return value


def plan(words: list[str], output: Console) -> None:
    """`skillstitch plan SPEC [options]`."""
    from orchestrator.cores import check_workers
    from orchestrator.costs.estimate import estimate
    from orchestrator.printing import data_lines, forecast_lines, plan_lines, suite_plan_lines
    from orchestrator.storage.ledger import Ledger
    from orchestrator.storage.store import Store
    from orchestrator.work.plan import make_plan

    command, asked = _with_spec(PlanCommand, "plan", words)
    check_workers(command.workers, command.address)
    if isinstance(asked, Suite):
        lines = suite_plan_lines(asked, command.store, command.workers)
    else:
        made, store = make_plan(asked), Store(command.store)
        left_out = list(data_lines(made, store))  # first: there may be data that cannot be used
        costs = estimate(made, store, Ledger.look(command.store / "blocks.sqlite"))
        lines = chain(
            plan_lines(asked, costs, command.workers),
            left_out,
            forecast_lines(made, store),
        )
    for line in lines:
        output.print(line, markup=False)


def run(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch run SPEC [options]`."""
    from orchestrator.printing import summary_lines
    from orchestrator.reporting import export
    from orchestrator.reproduction import Settings
    from orchestrator.storage.rundir import RunDirectory, default_out
    from orchestrator.suite_reproduction import reproduce_asked
    from orchestrator.work.progress import ConsoleProgress

    command, asked = _with_spec(RunCommand, "run", words)
    out = command.out or default_out(asked)
    settings = Settings(
        out,
        command.store,
        command.executor,
        command.workers,
        command.address,
        command.tracking_uri,
        command.dashboard,
    )
    if command.results is not None:
        from analysis.results import check_results

        with said_to_users():
            names = [table.id for table in asked.tables]
            check_results(command.results, names, asked.extent, command.force)
    incomplete = None
    with ConsoleProgress(errors) as progress:
        try:
            reproduce_asked(asked, settings, progress)
        except IncompleteError as error:
            if not RunDirectory(out).written:
                raise
            incomplete = error
    if command.results is not None:
        for line in export(out, command.results, force=command.force):
            output.print(line, markup=False)
    for line in summary_lines(RunDirectory(out)):
        output.print(line, markup=False)
    if incomplete is not None:
        raise incomplete
