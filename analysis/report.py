"""From a run directory to its report, and from there to the results kept with the code."""

import json
import shutil
from pathlib import Path

from analysis.episodes import write_episodes
from analysis.figures import Drawn, draw_figures
from analysis.page import render_page
from analysis.run import load_run
from analysis.skills import permutation_scores
from analysis.tables import Table, build_table
from analysis.writers import to_csv, to_latex, to_markdown


def build_report(run_dir: Path) -> Path:
    """Writes `episodes.parquet` and everything under `report/`; returns `report/index.html`.

    The same run contents give the same bytes, so a report can be rebuilt at any time.
    """
    _build(run_dir)
    return run_dir / "report" / "index.html"


def export_results(run_dir: Path, results_dir: Path) -> list[Path]:
    """Writes each table of a run to `results_dir/<table id>/`; returns these folders.

    Rebuilds the report first: what is kept can then not be older than the run.
    """
    tables, drawn = _build(run_dir)
    report = run_dir / "report"
    folders = []
    for table in tables:
        name = table.entry.id
        folder = results_dir / name
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for source, target in {
            report / f"{name}.csv": "scores.csv",
            report / f"{name}-gains.csv": "gains.csv",
            report / f"{name}.md": "table.md",
            report / f"{name}.tex": "table.tex",
        }.items():
            shutil.copyfile(source, folder / target)
        for figure in drawn:
            if figure.table in ("", name):
                for suffix in ("svg", "png"):
                    file = f"{figure.name}.{suffix}"
                    shutil.copyfile(report / "figures" / file, folder / "figures" / file)
        provenance = json.dumps(load_run(run_dir).provenance, indent=2, ensure_ascii=False)
        (folder / "provenance.json").write_text(provenance + "\n", encoding="utf-8")
        folders.append(folder)
    return folders


def _build(run_dir: Path) -> tuple[list[Table], list[Drawn]]:
    run = load_run(run_dir)
    episodes = write_episodes(run_dir)
    tables = [build_table(episodes, run.spec, entry) for entry in run.spec.tables]
    report = run_dir / "report"
    shutil.rmtree(report, ignore_errors=True)
    drawn = draw_figures(run, tables, report / "figures")
    for table in tables:
        name = table.entry.id
        _write(report / f"{name}.md", to_markdown(table))
        _write(report / f"{name}.tex", to_latex(table))
        _write(report / f"{name}.csv", to_csv(table.scores))
        _write(report / f"{name}-gains.csv", to_csv(table.gains))
    _write(report / "permutations.csv", to_csv(permutation_scores(episodes, run.spec)))
    page = render_page(run, episodes, tables, drawn, report / "figures")
    _write(report / "index.html", page)
    return tables, drawn


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
