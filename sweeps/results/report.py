"""What a sweep found, as a page, Markdown and CSV: first of all how much of it survives."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from optuna.importance import get_param_importances

from analysis.files import replaced_folder
from analysis.report import export_results
from analysis.results import check_results, write_provenance
from analysis.schema import PROVENANCE, leaves
from analysis.tables.writers import to_csv
from orchestrator.spec.structure import Plain
from orchestrator.storage.rundir import RunDirectory
from sweeps.questions import METRICS
from sweeps.results.again import command
from sweeps.results.figures import draw_figures
from sweeps.results.page import render_page
from sweeps.results.sections import HISTORY, Found, Section, sections
from sweeps.spec import SweepSpec
from sweeps.study import SweepStudy

TRIALS = "trials.json"


def results_names(sweep: SweepSpec) -> list[str]:
    """The folders of RESULTS/ that a sweep's export writes."""
    return [table.id for table in sweep.tables] or [sweep.name]


def write_report(
    sweep: SweepSpec,
    study: SweepStudy,
    directory: RunDirectory,
    results: Path | None,
    *,
    force: bool = False,
) -> None:
    """Write report/, and with `results` also what is kept with the code.

    That is RESULTS/<table>/ of a grid, as of any run, and of any other sweep the report without its
    page. Raises RunError where larger results are there, unless `force` is set.
    """
    trials = directory.read_json(TRIALS)
    confirmed = directory.read_json("confirm.json") or {}
    importances = field_importances(study)
    provenance = directory.read_json(PROVENANCE) or {}
    with replaced_folder(directory.path / "report") as folder:
        figures = draw_figures(sweep, trials, importances, folder / "figures")
        _write(folder / "trials.csv", to_csv(_flat(trials)))
        if confirmed:
            _write(folder / "confirm.csv", to_csv(_flat(confirmed["trials"])))
        shutil.copyfile(directory.path / TRIALS, folder / TRIALS)
        found = Found(
            sweep,
            trials,
            [trials[trial.number] for trial in study.ranked()],
            confirmed,
            importances,
            directory.read_json("counts.json") or {},
            provenance,
            command(directory, directory.asked_sweep() or {}),
            sorted(path.name for path in folder.iterdir() if path.is_file()),
        )
        told = sections(found, figures)
        _write(folder / "index.md", markdown(sweep, told))
        page = render_page(sweep, len(trials), told, folder / "figures")
        _write(folder / "index.html", page)
    if results is not None and sweep.tables:
        for exported in export_results(directory.path / "table", results, force=force):
            for figure in figures:
                for file in figure.files:
                    source = directory.path / "report" / "figures" / file
                    shutil.copyfile(source, exported / "figures" / f"sweep-{file}")
    elif results is not None:
        check_results(results, results_names(sweep), sweep.extent, force)
        with replaced_folder(results / sweep.name) as draft:
            report, page_alone = directory.path / "report", shutil.ignore_patterns("index.html")
            shutil.copytree(report, draft, dirs_exist_ok=True, ignore=page_alone)
            write_provenance(draft, results / sweep.name, provenance, sweep.extent)


def markdown(sweep: SweepSpec, told: Sequence[Section]) -> str:
    """The report as Markdown, which leaves out what is on the page only."""
    lines = [f"# {sweep.title}", ""]
    for section in told:
        if not section.on_page_only:
            lines += [f"## {section.title}", "", *section.lines, ""]
            for figure in section.figures:
                lines += [f"![{figure.caption}](figures/{figure.name}.png)", ""]
    return "\n".join(lines).rstrip() + "\n"


def summary(report: str) -> str:
    """What comes before the figures in a report as Markdown, for a terminal."""
    return report.partition(f"\n## {HISTORY}\n")[0].strip()


def field_importances(study: SweepStudy) -> dict[str, float]:
    """Field → importance for the first objective; none where there is too little to tell."""
    whole = {trial.values[0] for trial in study.finished}
    if len(study.sweep.space) < 2 or len(whole) < 2:
        return {}
    # The importances are asked for what makes the target low.
    sign = -1 if METRICS[study.sweep.objectives[0]].maximised else 1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return get_param_importances(study.study, target=lambda trial: sign * trial.values[0])


def _flat(rows: Sequence[Plain]) -> pd.DataFrame:
    """One column a field, without the gains by task."""
    dropped = ("fields", "setting", "tasks")
    return pd.DataFrame(
        [
            {"trial": row["trial"], **row["fields"]}
            | leaves({name: value for name, value in row.items() if name not in dropped}, " ")
            for row in rows
        ]
    )


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
