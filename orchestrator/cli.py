"""The front door: `skillstitch plan | run | sweep | status | list | report | …`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from orchestrator.errors import IncompleteError, SkillstitchError, UsageError, said_to_users
from orchestrator.executors import ExecutorKind
from orchestrator.interruption import interrupted_by_sigterm
from orchestrator.spec import Spec, packaged_specs
from orchestrator.store import USUAL_STORE
from orchestrator.suite import Suite, is_suite, load_asked, part_directories, with_specs

INTERRUPTED, UNREAD, TERMINATED = 130, 141, 143  # as shells count SIGINT, SIGPIPE and SIGTERM
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True)
OUTPUT = Console(highlight=False, soft_wrap=True)

OfSpec = Annotated[Spec, tyro.conf.arg(name="")]  # spec fields are options of the command itself


@dataclass(frozen=True)
class PlanCommand:
    """What a spec would train and simulate, and what that costs. Runs nothing."""

    spec: OfSpec
    store: Path = USUAL_STORE  # where artifacts and finished blocks are kept
    workers: int | None = None  # to estimate the time for; default: all cores
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
    tracking_uri: str | None = None  # MLflow; default: SQLite beside the store; none: off
    results: Path | None = None  # also export each table to RESULTS/<table>/
    force: bool = False  # let the exported tables replace larger ones
    from_sweep: str | None = None  # take a finished sweep's winner: its name or directory


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point; exits with 0, or the code of the error (see `orchestrator.errors`)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with interrupted_by_sigterm() as sigterm:
            _dispatch(words)
    except SkillstitchError as error:
        ERRORS.print(f"error: {error}", markup=False)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        ERRORS.print("interrupted; the same command resumes", markup=False)
        sys.exit(TERMINATED if sigterm.received else INTERRUPTED)
    except BrokenPipeError:  # nobody reads on, as after `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(UNREAD)


def _dispatch(words: list[str]) -> None:
    name, rest = (words[0], words[1:]) if words else ("--help", [])
    if name in ("-h", "--help"):
        OUTPUT.print(_usage(), markup=False)
        return
    if name == "--version":
        OUTPUT.print(f"skillstitch {version('skillstitch')}", markup=False)
        return
    if name not in COMMANDS:
        raise UsageError(f"unknown command {name!r}; there are {', '.join(COMMANDS)}")
    COMMANDS[name][0](rest)


def _usage() -> str:
    lines = [f"  {name:<9}{summary}" for name, (_, summary) in COMMANDS.items()]
    return "\n".join(
        [
            "usage: skillstitch COMMAND ...",
            "",
            "Reproduces and extends Offline Model-Based Skill Stitching.",
            "",
            *lines,
            "",
            f"Specs: {', '.join(packaged_specs())}, or a TOML file. "
            "COMMAND --help tells the options.",
        ]
    )


def _with_spec(command: type[Any], name: str, words: list[str]) -> tuple[Any, Spec | Suite]:
    """Parse `SPEC [options]`; every field of the spec is an option, its default the spec's own.

    The fields of a suite's parts differ: the same words are read for each of them.
    """
    program = f"skillstitch {name} SPEC"
    if not words or words[0].startswith("-"):
        if words and words[0] in ("-h", "--help"):
            words = [packaged_specs()[0], "--help"]
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
            commands.append(tyro.cli(command, default=command(spec), args=words[1:], prog=program))
        except SystemExit as end:
            if end.code and len(specs) > 1:
                raise UsageError(f"options apply to every part; so read for {spec.name}") from None
            raise
    if isinstance(asked, Suite):
        return commands[0], with_specs(asked, [each.spec for each in commands])
    return commands[0], commands[0].spec


def _option(words: list[str], name: str) -> str:
    """The value of an option that decides the defaults of all others."""
    value = ""
    for word, following in zip(words, [*words[1:], ""], strict=True):
        if word == name:
            value = following
        elif word.startswith(f"{name}="):
            value = word.partition("=")[2]
    return value


def _plan(words: list[str]) -> None:
    from orchestrator.costs import estimate
    from orchestrator.ledger import Ledger
    from orchestrator.plan import make_plan
    from orchestrator.printing import forecast_lines, plan_lines, suite_plan_lines
    from orchestrator.reproduce import check_workers
    from orchestrator.store import Store

    command, asked = _with_spec(PlanCommand, "plan", words)
    check_workers(command.workers)
    if isinstance(asked, Suite):
        lines = suite_plan_lines(asked, command.store, command.workers)
    else:
        plan, store = make_plan(asked), Store(command.store)
        costs = estimate(plan, store, Ledger.look(command.store / "blocks.sqlite"))
        lines = chain(plan_lines(asked, costs, command.workers), forecast_lines(plan, store))
    for line in lines:
        OUTPUT.print(line, markup=False)


def _run(words: list[str]) -> None:
    from orchestrator.printing import summary_lines
    from orchestrator.progress import ConsoleProgress
    from orchestrator.reproduce import Settings, reproduce
    from orchestrator.reproduce_suite import reproduce_suite
    from orchestrator.rundir import RunDirectory, default_out

    command, asked = _with_spec(RunCommand, "run", words)
    out = command.out or default_out(asked)
    settings = Settings(
        out,
        command.store,
        command.executor,
        command.workers,
        command.address,
        command.tracking_uri,
    )
    if command.results is not None:
        from analysis.results import check_results

        with said_to_users():
            names = [table.id for table in asked.tables]
            check_results(command.results, names, asked.extent, command.force)
    incomplete = None
    with ConsoleProgress(ERRORS) as progress:
        try:
            if isinstance(asked, Suite):
                reproduce_suite(asked, settings, progress)
            else:
                reproduce(asked, settings, progress)
        except IncompleteError as error:
            if not (out / "finished").is_file():
                raise
            incomplete = error
    if command.results is not None:
        _export(out, command.results, command.force)
    for line in summary_lines(RunDirectory(out)):
        OUTPUT.print(line, markup=False)
    if incomplete is not None:
        raise incomplete


def _sweep(words: list[str]) -> None:
    from sweeps.command import sweep

    sweep(words, OUTPUT, ERRORS)


def _export(run: Path, results: Path, force: bool) -> None:
    from analysis.report import export_results
    from orchestrator.rundir import RunDirectory

    with RunDirectory(run).locked(), said_to_users():
        folders = export_results(run, results, force=force)
    for folder in folders:
        OUTPUT.print(f"exported {folder}", markup=False)


def _status(words: list[str]) -> None:
    from orchestrator.printing import status_lines, suite_status_lines
    from orchestrator.reproduce import catch_up
    from orchestrator.rundir import RunDirectory

    def status(run: tyro.conf.Positional[Path], store: Path | None = None) -> None:
        """How far a run directory is.

        Args:
            run: the run directory.
            store: where its artifacts are kept; default: where it was last carried out.
        """
        directory = RunDirectory(run)
        lines = suite_status_lines if is_suite(directory) else status_lines
        for line in lines(directory, store):
            OUTPUT.print(line, markup=False)
        for each in (*part_directories(directory).values(), directory):
            if trouble := catch_up(each):
                ERRORS.print(f"tracking: {trouble}", markup=False)

    tyro.cli(status, args=words, prog="skillstitch status")


def _list(words: list[str]) -> None:
    from orchestrator.listing import listing_lines

    def list_(folder: tyro.conf.Positional[Path] = Path("runs")) -> None:
        """Every run and sweep in a folder: what was asked, how far it is, when it last went on.

        Args:
            folder: the folder.
        """
        for line in listing_lines(folder):
            OUTPUT.print(line, markup=False)

    tyro.cli(list_, args=words, prog="skillstitch list")


def _report(words: list[str]) -> None:
    from analysis.report import build_report
    from orchestrator.merge import merge_again
    from orchestrator.reproduce import catch_up
    from orchestrator.rundir import RunDirectory

    def report(
        run: tyro.conf.Positional[Path], results: Path | None = None, force: bool = False
    ) -> None:
        """Write a run's tables, figures and report again from its segments, or a sweep's.

        Args:
            run: the directory of the run or sweep.
            results: also export each table to RESULTS/<table>/.
            force: let the exported tables replace larger ones.
        """
        directory = RunDirectory(run)
        if directory.asked_sweep():
            from sweeps.sweep import report_again

            with said_to_users():
                report_again(directory, results, force=force)
            OUTPUT.print(f"wrote {run / 'report' / 'index.md'}", markup=False)
            return
        suite = is_suite(directory)  # a clear error where there is no run
        with directory.locked(), said_to_users():
            if suite:
                merge_again(directory)
            page = run / "report" / "index.html"
            if results is None:
                build_report(run)
        if results is not None:  # builds it, too
            _export(run, results, force)
        OUTPUT.print(f"wrote {page}", markup=False)
        if trouble := catch_up(RunDirectory(run)):
            ERRORS.print(f"tracking: {trouble}", markup=False)

    tyro.cli(report, args=words, prog="skillstitch report")


def _compare(words: list[str]) -> None:
    from analysis.compare import compare, comparison_markdown, settings_apart, settings_markdown

    def both(run_a: tyro.conf.Positional[Path], run_b: tyro.conf.Positional[Path]) -> None:
        """Two runs side by side, paired on the episodes that both played.

        Args:
            run_a: a run directory.
            run_b: another; differences are B − A.
        """
        with said_to_users():
            text = comparison_markdown(compare(run_a, run_b), run_a.name, run_b.name)
            asked = settings_markdown(settings_apart(run_a, run_b), run_a.name, run_b.name)
        OUTPUT.print(f"{text}\n## What was asked differently\n\n{asked}", markup=False)

    tyro.cli(both, args=words, prog="skillstitch compare")


def _doctor(words: list[str]) -> None:
    from orchestrator.doctor import as_lines, as_table, diagnose, has_faults

    def doctor(root: Path = Path("runs")) -> None:
        """Check this machine and the installation, with a one-second self test.

        Args:
            root: where runs are to be kept.
        """
        findings = diagnose(root)
        if OUTPUT.is_terminal:
            OUTPUT.print(as_table(findings))
        else:
            for line in as_lines(findings):
                OUTPUT.print(line, markup=False)
        if has_faults(findings):
            sys.exit(1)

    tyro.cli(doctor, args=words, prog="skillstitch doctor")


def _gc(words: list[str]) -> None:
    from orchestrator.gc import collect_garbage

    def gc(
        runs: tyro.conf.Positional[tuple[Path, ...]],
        store: Path = USUAL_STORE,
        delete: bool = False,
    ) -> None:
        """Find artifacts and blocks that none of the given run directories needs.

        Args:
            runs: run directories whose artifacts and blocks are to be kept.
            store: the store to clean.
            delete: delete what was found; without it, nothing is touched.
        """
        for line in collect_garbage(store, runs, delete=delete):
            OUTPUT.print(line, markup=False)

    tyro.cli(gc, args=words, prog="skillstitch gc")


COMMANDS: dict[str, tuple[Callable[[list[str]], None], str]] = {
    "plan": (_plan, "what a spec would train and simulate, and what that costs"),
    "run": (_run, "carry a spec out, or resume it; ends with tables and report"),
    "sweep": (_sweep, "search over a spec's fields, or resume it; ends with its winner"),
    "status": (_status, "how far a run directory is"),
    "list": (_list, "every run and sweep in a folder, and how far each is"),
    "report": (_report, "write a run's or sweep's report again, and export its tables"),
    "compare": (_compare, "two runs side by side, paired"),
    "doctor": (_doctor, "check this machine and the installation"),
    "gc": (_gc, "delete artifacts and blocks that no run directory needs"),
}

if __name__ == "__main__":
    main()
