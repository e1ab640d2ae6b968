"""The command line: `skillstitch plan | run | sweep | status | list | report | …`.

Each command imports what it needs: torch and the simulators take seconds, and help needs neither.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import tyro
from rich.console import Console

from orchestrator.errors import SkillstitchError, UsageError, said_to_users
from orchestrator.interruption import interrupted_by_sigterm
from orchestrator.lazily import import_lazily
from orchestrator.spec.tomls import packaged_specs
from stitching.registry import PartError

INTERRUPTED, UNREAD, TERMINATED = 130, 141, 143  # as shells count SIGINT, SIGPIPE and SIGTERM
RUN_PACKAGES = ("torch", "mujoco", "ray", "optuna", "mlflow", "gymnasium_robotics", "robosuite")
ERRORS = Console(stderr=True, highlight=False, soft_wrap=True)
OUTPUT = Console(highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point; exits with 0, or the code of the error (see `orchestrator.errors`)."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with interrupted_by_sigterm() as sigterm:
            _dispatch(words)
    except SkillstitchError as error:
        ERRORS.print(f"error: {error}", markup=False)
        sys.exit(error.exit_code)
    except PartError as error:
        ERRORS.print(f"error: {error}; mend or uninstall it", markup=False)
        sys.exit(UsageError.exit_code)
    except ModuleNotFoundError as error:
        if error.name not in RUN_PACKAGES:
            raise
        ERRORS.print(
            f"error: {error.name} is not installed, and this command trains, plays or plans: "
            "install skillstitch with its extra `run`, as in `pip install -e '.[run]'`",
            markup=False,
        )
        sys.exit(UsageError.exit_code)
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


def _plan(words: list[str]) -> None:
    tyro.cli(int, args=["0"])  # tyro looks for torch once; if it is there by then, tyro uses it
    import_lazily("torch")
    from orchestrator.spec_commands import plan

    plan(words, OUTPUT)


def _run(words: list[str]) -> None:
    from orchestrator.spec_commands import run

    run(words, OUTPUT, ERRORS)


def _sweep(words: list[str]) -> None:
    from sweeps.command import sweep

    sweep(words, OUTPUT, ERRORS)


def _status(words: list[str]) -> None:
    from orchestrator.status import status_lines
    from orchestrator.storage.rundir import RunDirectory
    from orchestrator.tracking.run import catch_up

    def status(run: tyro.conf.Positional[Path], store: Path | None = None) -> None:
        """How far a run directory is.

        Args:
            run: the run directory.
            store: where its artifacts are kept; default: where it was last carried out.
        """
        directory = RunDirectory(run)
        for line in status_lines(directory, store):
            OUTPUT.print(line, markup=False)
        for each in (*directory.parts.values(), directory):
            if trouble := catch_up(each):
                ERRORS.print(f"tracking: {trouble}", markup=False)

    tyro.cli(status, args=words, prog="skillstitch status")


def _list(words: list[str]) -> None:
    from orchestrator.storage.listing import listing_lines

    def list_(folder: tyro.conf.Positional[Path] = Path("runs")) -> None:
        """Every run and sweep in a folder: what was asked, how far it is, when it last went on.

        Args:
            folder: the folder.
        """
        for line in listing_lines(folder):
            OUTPUT.print(line, markup=False)

    tyro.cli(list_, args=words, prog="skillstitch list")


def _report(words: list[str]) -> None:
    from orchestrator.reporting import report_again
    from orchestrator.storage.rundir import RunDirectory
    from orchestrator.tracking.run import catch_up

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
            from sweeps.sweep import report_again as sweep_report_again

            with said_to_users():
                sweep_report_again(directory, results, force=force)
            OUTPUT.print(f"wrote {run / 'report' / 'index.md'}", markup=False)
            return
        for line in report_again(run, results, force=force):
            OUTPUT.print(line, markup=False)
        if trouble := catch_up(directory):
            ERRORS.print(f"tracking: {trouble}", markup=False)

    tyro.cli(report, args=words, prog="skillstitch report")


def _enjoy(words: list[str]) -> None:
    from analysis.schema import SEPARATOR
    from orchestrator.film import film
    from orchestrator.replay import Asked
    from orchestrator.storage.rundir import RunDirectory

    def enjoy(
        run: tyro.conf.Positional[Path],
        task: str,
        method: str,
        seed: int = 0,
        episode: int | None = None,
        store: Path | None = None,
        out: Path | None = None,
    ) -> None:
        """Play an episode of a run again, exactly, and write it as a film and as pictures.

        Args:
            run: the run directory.
            task: its skills in their order, as "microwave>kettle".
            method: one of the run's methods.
            seed: whose models play.
            episode: its number, from 0; default: the first that accomplishes most.
            store: where the models are kept; default: where the run was last carried out.
            out: the film; default: one in RUN/episodes/ with all this in its name.
        """
        asked = Asked(tuple(task.split(SEPARATOR)), method, seed, episode)
        for line in film(RunDirectory(run), asked, store, out):
            OUTPUT.print(line, markup=False)

    tyro.cli(enjoy, args=words, prog="skillstitch enjoy")


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
            OUTPUT.print(line, markup=False)

    tyro.cli(gc, args=words, prog="skillstitch gc")


COMMANDS: dict[str, tuple[Callable[[list[str]], None], str]] = {
    "plan": (_plan, "what a spec would train and simulate, and what that costs"),
    "run": (_run, "carry a spec out, or resume it; ends with tables and report"),
    "sweep": (_sweep, "search over a spec's fields, or resume it; ends with its winner"),
    "status": (_status, "how far a run directory is"),
    "list": (_list, "every run and sweep in a folder, and how far each is"),
    "report": (_report, "write a run's or sweep's report again, and export its tables"),
    "enjoy": (_enjoy, "an episode of a run, played again, as a film"),
    "compare": (_compare, "two runs side by side, paired"),
    "doctor": (_doctor, "check this machine and the installation"),
    "gc": (_gc, "delete artifacts and blocks that no run directory needs"),
}

if __name__ == "__main__":
    main()
