"""The command line: `skillstitch plan | run | sweep | status | list | report | …`.

Each command imports what it needs: torch and the simulators take seconds, and help needs neither.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from io import TextIOWrapper
from pathlib import Path

import tyro
from rich.console import Console

from orchestrator import run_commands
from orchestrator.errors import UsageError, explained
from orchestrator.interruption import interrupted_by_sigterm
from orchestrator.lazily import import_lazily
from orchestrator.libraries import give_places, set_drawing_aside
from orchestrator.spec.tomls import packaged_specs

INTERRUPTED, UNREAD, TERMINATED = 130, 141, 143  # as shells count SIGINT, SIGPIPE and SIGTERM
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True)
OUTPUT = Console(highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point; exits with 0, or the code of the error (see `orchestrator.errors`)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    _print_in_any_encoding()
    set_drawing_aside()
    give_places()
    try:
        with interrupted_by_sigterm() as sigterm:
            _dispatch(words)
    except KeyboardInterrupt:
        ERRORS.print("interrupted; the same command resumes", markup=False)
        sys.exit(TERMINATED if sigterm.received else INTERRUPTED)
    except BrokenPipeError:  # nobody reads on, as after `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(UNREAD)
    except Exception as error:
        told = explained(error)
        if told is None:
            raise
        line, code = told
        ERRORS.print(f"error: {line}", markup=False)
        sys.exit(code)


def _print_in_any_encoding() -> None:
    """What a terminal or a log cannot show, as α or a path of odd bytes, is written as its code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


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
    COMMANDS[name][0](rest, OUTPUT, ERRORS)


def _usage() -> str:
    lines = [f"  {name:<12}{summary}" for name, (_, summary) in COMMANDS.items()]
    return "\n".join(
        [
            "usage: skillstitch COMMAND ...",
            "",
            "Reproduces and extends Offline Model-Based Skill Stitching.",
            "",
            *lines,
            "",
            f"Specs: {', '.join(packaged_specs())}, or a TOML file. "
            "COMMAND --help tells the options; of run and plan --help-all tells all.",
        ]
    )


def _plan(words: list[str], output: Console, errors: Console) -> None:
    tyro.cli(int, args=["0"])  # tyro looks for torch once; if it is there by then, tyro uses it
    import_lazily("torch")
    from orchestrator.spec_commands import plan

    plan(words, output)


def _run(words: list[str], output: Console, errors: Console) -> None:
    from orchestrator.spec_commands import run

    run(words, output, errors)


def _sweep(words: list[str], output: Console, errors: Console) -> None:
    from sweeps.command import sweep

    sweep(words, output, errors)


def _check_data(words: list[str], output: Console, errors: Console) -> None:
    tyro.cli(int, args=["0"])  # as in `_plan`
    import_lazily("torch")
    from orchestrator.benchmarks.check_data import check_data_lines

    def check_data(data: tyro.conf.Positional[str], benchmark: str) -> None:
        """Whether a run could learn from your own data, and what they hold. Runs nothing.

        Args:
            data: an .npz file, or the id of a Minari dataset: docs/own-data.md.
            benchmark: what they are data of: maze, kitchen, robosuite-door, robosuite-can.
        """
        for line in check_data_lines(data, benchmark):
            output.print(line, markup=False)

    tyro.cli(check_data, args=words, prog="skillstitch check-data")


def _doctor(words: list[str], output: Console, errors: Console) -> None:
    from orchestrator.doctor import as_lines, as_table, diagnose, has_faults

    def doctor(root: Path = Path("runs")) -> None:
        """Check this machine and the installation, with a one-second self test.

        Args:
            root: where runs are to be kept.
        """
        findings = diagnose(root)
        if output.is_terminal:
            output.print(as_table(findings))
        else:
            for line in as_lines(findings):
                output.print(line, markup=False)
        if has_faults(findings):
            sys.exit(1)

    tyro.cli(doctor, args=words, prog="skillstitch doctor")


def _gc(words: list[str], output: Console, errors: Console) -> None:
    from orchestrator.storage.gc import collect_garbage
    from orchestrator.storage.store import USUAL_STORE

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
            output.print(line, markup=False)

    tyro.cli(gc, args=words, prog="skillstitch gc")


Command = Callable[[list[str], Console, Console], None]
"""command(words, output, errors)"""

COMMANDS: dict[str, tuple[Command, str]] = {
    "plan": (_plan, "what a spec would train and simulate, and what that costs"),
    "run": (_run, "carry a spec out, or resume it; ends with tables and report"),
    "sweep": (_sweep, "search over a spec's fields, or resume it; ends with its winner"),
    "status": (run_commands.status, "how far a run or a sweep is, and what to do next"),
    "list": (run_commands.list_runs, "every run and sweep in a folder, and how far each is"),
    "report": (run_commands.report, "write a run's or sweep's report again, and export its tables"),
    "enjoy": (run_commands.enjoy, "an episode of a run, played again, as a film"),
    "export": (run_commands.export, "a run's models and data, for use without its store"),
    "compare": (run_commands.compare, "two runs side by side, paired"),
    "check-data": (_check_data, "whether your own data can be learned from, and what they hold"),
    "doctor": (_doctor, "check this machine and the installation"),
    "gc": (_gc, "delete artifacts and blocks that no run directory needs"),
}

if __name__ == "__main__":
    main()
