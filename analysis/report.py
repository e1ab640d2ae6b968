"""From a run directory to its report, and from there to the results kept with the code."""

import shutil
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from analysis.episodes import write_episodes
from analysis.figures import draw_figures
from analysis.figures.drawn import Drawn
from analysis.files import replaced_folder
from analysis.page.distribution import distribution_markdown
from analysis.page.origin import origin_markdown
from analysis.page.page import render_page
from analysis.page.profile import profile_markdown
from analysis.page.sources import CSVS, csv_tables, file_name, source_markdown
from analysis.paper.profile import profiles
from analysis.results import check_results, write_provenance
from analysis.run import Run, load_run
from analysis.schema import QUARANTINE, SEGMENTS, SPEC
from analysis.studies.data import undemonstrated, undemonstrated_note
from analysis.studies.forecast import forecast_table
from analysis.studies.models import model_table
from analysis.studies.pairs import both_skills, pair_groups, pair_table, second_skills, shown_orders
from analysis.studies.rates import HEADER, NOTE, rate_lines, rate_table
from analysis.studies.stitches import outcome_table, stitch_table
from analysis.tables.skills import permutation_scores, single_skill_rates
from analysis.tables.table import Table, build_table
from analysis.tables.writers import markdown_table, to_csv, to_latex, to_markdown

Studies = dict[str, pd.DataFrame]


def build_report(run_dir: Path) -> Path:
    """Writes `episodes.parquet` and everything under `report/`; returns `report/index.html`.

    The same run contents give the same bytes, so a report can be rebuilt at any time. Until the
    new one is whole, the old one stays.
    """
    _build(run_dir)
    return run_dir / "report" / "index.html"


def export_results(run_dir: Path, results_dir: Path, *, force: bool = False) -> list[Path]:
    """Writes each table of a run to `results_dir/<table id>/`; returns these folders.

    With what was asked, every segment played and what was given up, so that `open_run` reads the
    tables and gains off such a folder as off the run itself. Each takes the place of an older one
    in one step, and nothing of that one stays. Rebuilds the report first: what is kept can then not
    be older than the run. Raises RunError where a folder holds larger results, unless `force`.
    """
    run = load_run(run_dir)
    check_results(results_dir, [entry.id for entry in run.spec.tables], run.spec.extent, force)
    tables, studies, drawn = _build(run_dir)
    report = run_dir / "report"
    folders = []
    for table in tables:
        name = table.entry.id
        folder = results_dir / name
        with replaced_folder(folder) as draft:
            _copy_table(name, report, studies, drawn, draft)
            _write(draft / "table.md", _markdown(run, table, studies, kept=True))
            for file in (SPEC, QUARANTINE):
                if (run_dir / file).is_file():
                    shutil.copyfile(run_dir / file, draft / file)
            in_order = run.segments.sort_values(["seed", "method", "prefix", "episode"])
            in_order.to_parquet(draft / SEGMENTS, index=False)
            write_provenance(draft, folder, run.provenance, run.spec.extent)
        folders.append(folder)
    return folders


def _copy_table(
    name: str, report: Path, studies: Iterable[str], drawn: list[Drawn], folder: Path
) -> None:
    for source, target in {
        **{file_name(name, kind): file_name(name, kind, kept=True) for kind in CSVS},
        f"{name}.tex": "table.tex",
        **{
            file.name: file.name
            for study in studies
            for file in (report / f"{study}.csv", report / f"{study}.md")
        },
    }.items():
        if (report / source).is_file():
            shutil.copyfile(report / source, folder / target)
    (folder / "figures").mkdir()
    for figure in drawn:
        if figure.table in ("", name):
            for file in figure.files:
                shutil.copyfile(report / "figures" / file, folder / "figures" / file)


def _build(run_dir: Path) -> tuple[list[Table], Studies, list[Drawn]]:
    run = load_run(run_dir)
    episodes = write_episodes(run_dir)
    tables = [build_table(episodes, run.spec, entry) for entry in run.spec.tables]
    studies = _studies(run)
    with replaced_folder(run_dir / "report") as report:
        drawn = draw_figures(run, tables, report / "figures", studies.get("forecast"))
        for table in tables:
            name = table.entry.id
            _write(report / f"{name}.md", _markdown(run, table, studies))
            _write(report / f"{name}.tex", to_latex(table))
            for kind, lines in csv_tables(table).items():
                _write(report / file_name(name, kind), to_csv(lines))
        _write(report / "permutations.csv", to_csv(permutation_scores(episodes, run.spec)))
        singles = single_skill_rates(run.segments, run.spec)
        _write(report / "single-skills.csv", to_csv(singles))
        for name, study in studies.items():
            _write(report / f"{name}.csv", to_csv(study))
        if "profile" in studies:
            _write(report / "profile.md", profile_markdown(studies["profile"], run.spec))
        page = render_page(run, episodes, tables, studies, drawn, report / "figures")
        _write(report / "index.html", page)
    return tables, studies, drawn


def _studies(run: Run) -> Studies:
    """What is known beside the tables, by the name of its file; empty for most benchmarks."""
    studies = {}
    orders = shown_orders(run.datasets)
    seconds = second_skills(run.segments, run.spec)
    if orders is not None and not seconds.empty:
        both = both_skills(run.segments, run.spec, run.quarantine)
        studies["pairs"] = pair_table(seconds, both, orders, run.spec)
        studies["pair-groups"] = pair_groups(seconds, both, orders, run.spec)
    beside_table_8 = profiles(run)
    if beside_table_8 is not None:
        studies["profile"] = beside_table_8
    if run.diagnosis:
        studies["models"] = model_table(run)
    foretold = forecast_table(run)
    if not foretold.empty:
        studies["forecast"] = foretold
    if run.diagnoses:
        studies["rates"] = rate_table(run)
    if run.stitches:
        studies["stitch-outcomes"], studies["stitches"] = outcome_table(run), stitch_table(run)
    return studies


def _markdown(run: Run, table: Table, studies: Studies, *, kept: bool = False) -> str:
    """The table, and what is told beside it; `kept`: in a folder of its own, beside its CSVs."""
    parts = [to_markdown(table)]
    left_out = undemonstrated_note(undemonstrated(run))
    if left_out:
        parts.append(f"**{left_out}**\n")
    if "rates" in studies:
        lines = markdown_table(HEADER, rate_lines(studies["rates"]))
        parts.append(f"## What there is to stitch\n\n{lines}\n\n{NOTE}\n")
    parts += [distribution_markdown(table), source_markdown(table, kept=kept)]
    return "\n".join(filter(None, [*parts, origin_markdown(run.spec)]))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
