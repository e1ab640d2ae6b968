"""The commands that take run directories. Each imports what it needs: some read files alone."""

from __future__ import annotations

from pathlib import Path

import tyro
from rich.console import Console

from orchestrator.errors import said_to_users


def status(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch status RUN`."""
    from orchestrator.status import status_lines
    from orchestrator.storage.rundir import RunDirectory
    from orchestrator.tracking.run import catch_up

    def status(run: tyro.conf.Positional[Path], store: Path | None = None) -> None:
        """How far a run or a sweep is.

        Args:
            run: the directory of the run or sweep.
            store: where its artifacts are kept; default: where it was last carried out.
        """
        directory = RunDirectory(run)
        if directory.asked_sweep():
            from sweeps.results.status import sweep_lines

            lines = sweep_lines(directory, store)
        else:
            lines = status_lines(directory, store)
        for line in lines:
            output.print(line, markup=False)
        for each in (*directory.parts.values(), directory):
            if trouble := catch_up(each):
                errors.print(f"tracking: {trouble}", markup=False)

    tyro.cli(status, args=words, prog="skillstitch status")


def list_runs(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch list [FOLDER]`."""
    from orchestrator.storage.listing import listing_lines
    from sweeps.results.status import state

    def list_(folder: tyro.conf.Positional[Path] = Path("runs")) -> None:
        """Every run and sweep in a folder: what was asked, how far it is, when it last went on.

        Args:
            folder: the folder.
        """
        for line in listing_lines(folder, state):
            output.print(line, markup=False)

    tyro.cli(list_, args=words, prog="skillstitch list")


def report(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch report RUN`."""
    from orchestrator.reporting import report_again
    from orchestrator.storage.rundir import RunDirectory
    from orchestrator.tracking.run import catch_up

    def report(
        run: tyro.conf.Positional[Path], results: Path | None = None, force: bool = False
    ) -> None:
        """Write a run's tables, figures and report again from its segments, or a sweep's.

        Args:
            run: the directory of the run or sweep.
            results: also export: each table to RESULTS/<table>/; of other sweeps RESULTS/<name>/.
            force: let the exported tables replace larger ones.
        """
        directory = RunDirectory(run)
        if directory.asked_sweep():
            from sweeps.sweep import report_again as sweep_report_again

            with said_to_users():
                sweep_report_again(directory, results, force=force)
            output.print(f"wrote {run / 'report' / 'index.html'}", markup=False)
            return
        for line in report_again(run, results, force=force):
            output.print(line, markup=False)
        if trouble := catch_up(directory):
            errors.print(f"tracking: {trouble}", markup=False)

    tyro.cli(report, args=words, prog="skillstitch report")


def enjoy(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch enjoy RUN --task TASK --method METHOD`."""
    from analysis.schema import SEPARATOR
    from orchestrator.episodes.film import film
    from orchestrator.episodes.replay import Asked
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
            output.print(line, markup=False)

    tyro.cli(enjoy, args=words, prog="skillstitch enjoy")


def export(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch export RUN --out FOLDER`."""
    from orchestrator.export import export_run
    from orchestrator.storage.rundir import RunDirectory

    def export(run: tyro.conf.Positional[Path], out: Path, store: Path | None = None) -> None:
        """Write a run's models and data as files of their own, for use without its store.

        Args:
            run: the run directory.
            out: a new folder: models as safetensors with a card each, data as Minari datasets.
            store: where they are kept; default: where the run was last carried out.
        """
        for line in export_run(RunDirectory(run), out, store):
            output.print(line, markup=False)

    tyro.cli(export, args=words, prog="skillstitch export")


def compare(words: list[str], output: Console, errors: Console) -> None:
    """`skillstitch compare RUN RUN`."""
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
        output.print(f"{text}\n## What was asked differently\n\n{asked}", markup=False)

    tyro.cli(both, args=words, prog="skillstitch compare")
