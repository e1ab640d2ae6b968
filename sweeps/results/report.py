"""What a sweep found, as Markdown and CSV, with figures: first of all how much of it survives."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
from optuna.importance import get_param_importances

from analysis.figures.drawn import DRAWING
from analysis.files import replaced_folder
from analysis.report import export_results
from analysis.results import check_results, write_provenance
from analysis.schema import PROVENANCE, leaves
from analysis.tables.writers import to_csv
from orchestrator.spec.structure import Plain
from orchestrator.storage.rundir import RunDirectory
from sweeps.confirm import confirm_spec
from sweeps.questions import METRICS
from sweeps.results.figures import draw_figures
from sweeps.search import search_spec
from sweeps.spec import SweepSpec
from sweeps.study import SweepStudy


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

    That is RESULTS/<table>/ of a grid, as of any run, and the report itself of any other sweep.
    Raises RunError where larger results are there, unless `force` is set.
    """
    trials = directory.read_json("trials.json")
    confirmed = directory.read_json("confirm.json") or {}
    importances = field_importances(study)
    with replaced_folder(directory.path / "report") as folder:
        figures = draw_figures(sweep, trials, importances, folder / "figures")
        _write(folder / "trials.csv", to_csv(_flat(trials)))
        if confirmed:
            _write(folder / "confirm.csv", to_csv(_flat(confirmed["trials"])))
        ranked = [trials[trial.number] for trial in study.ranked()]
        lines = [
            *head_lines(sweep, trials),
            *confirm_lines(sweep, ranked[0], confirmed),
            *sweep.question.trial_lines(sweep.objectives, ranked),
            "",
            *importance_lines(importances),
            *cost_lines(directory.read_json("counts.json")),
            *(f"![{name}](figures/{name}.png)" for name in figures),
        ]
        _write(folder / "index.md", "\n".join(lines).rstrip() + "\n")
    if results is not None and sweep.tables:
        for exported in export_results(directory.path / "table", results, force=force):
            for name in figures:
                for suffix in DRAWING:
                    source = directory.path / "report" / "figures" / f"{name}.{suffix}"
                    shutil.copyfile(source, exported / "figures" / f"sweep-{source.name}")
    elif results is not None:
        check_results(results, results_names(sweep), sweep.extent, force)
        with replaced_folder(results / sweep.name) as draft:
            shutil.copytree(directory.path / "report", draft, dirs_exist_ok=True)
            provenance = directory.read_json(PROVENANCE) or {}
            write_provenance(draft, results / sweep.name, provenance, sweep.extent)


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


def head_lines(sweep: SweepSpec, trials: Sequence[Plain]) -> Iterator[str]:
    """What was searched, and how."""
    spec = search_spec(sweep)
    given_up = sum(trial["pruned"] for trial in trials)
    seeds = f"{spec.seeds} seed{'s' if spec.seeds > 1 else ''}"
    yield f"# {sweep.title}"
    yield ""
    yield (
        f"Sweep `{sweep.name}` at {sweep.scale} scale over `{Path(sweep.base).stem}`: "
        f"{len(trials)} trials ({sweep.sampler}, {given_up} given up early), each on "
        f"{len(spec.tasks)} tasks × {seeds} × {spec.episodes} episodes. "
        f"{sweep.question.note} {sweep.question.seeds_note(spec.seeds)}"
    )
    yield ""


def confirm_lines(sweep: SweepSpec, best: Plain, confirmed: Plain) -> Iterator[str]:
    """The winner, and what is left of it where the search has never been."""
    question = sweep.question
    yield "## Winner"
    yield ""
    yield f"Trial {best['trial']}: {best['setting']}. In the search: {question.headline(best)}."
    yield ""
    if not confirmed:
        yield (
            f"It was not judged again: its {question.main} is that of the best of many, and so too "
            "good. Set `confirm` to learn how much of it survives."
        )
        yield ""
        return
    spec, seeds = confirm_spec(sweep)
    where = "held-out tasks" if confirmed["held_out"] else "tasks of the search"
    numbers = ", ".join(map(str, seeds))
    yield (
        f"Judged again on {len(spec.tasks)} {where} by new seeds ({numbers}; root seed "
        f"{spec.root_seed}), {spec.episodes} episodes each. {question.seeds_note(len(seeds))}"
    )
    yield ""
    yield from question.confirmed_lines(confirmed)
    yield ""


def importance_lines(importances: dict[str, float]) -> Iterator[str]:
    """How much each searched field matters; nothing where that is not known."""
    if importances:
        shares = ", ".join(f"`{path}` {share:.2f}" for path, share in importances.items())
        yield f"Importances (PED-ANOVA): {shares}."
        yield ""


def cost_lines(counts: Plain) -> Iterator[str]:
    """What was played for the sweep; all else was found in the store."""
    yield "## What it took"
    yield ""
    for name, kinds in counts.items():
        parts = ", ".join(f"{kind} {count:,}" for kind, count in kinds.items()) or "none"
        yield f"- {name}: {parts}"
    yield ""


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
