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
from analysis.writers import seed_note, to_csv
from orchestrator.rundir import RunDirectory
from orchestrator.structure import Plain
from sweeps.confirm import confirm_spec
from sweeps.figures import LABELS, draw_figures, pareto_front
from sweeps.search import search_spec
from sweeps.spec import MAXIMISED, SweepSpec
from sweeps.study import SweepStudy

SHOWN = 10  # of the best trials


def write_report(
    sweep: SweepSpec, study: SweepStudy, directory: RunDirectory, results: Path | None
) -> None:
    """Write report/, and with `results` also what is kept with the code.

    That is RESULTS/<table>/ of a grid, as of any run, and the report itself of any other sweep.
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
            *trial_lines(sweep, ranked),
            *importance_lines(importances),
            *cost_lines(directory.read_json("counts.json")),
            *(f"![{name}](figures/{name}.png)" for name in figures),
        ]
        _write(folder / "index.md", "\n".join(lines).rstrip() + "\n")
    if results is not None and sweep.tables:
        for exported in export_results(directory.path / "table", results):
            for name in figures:
                for suffix in DRAWING:
                    source = directory.path / "report" / "figures" / f"{name}.{suffix}"
                    shutil.copyfile(source, exported / "figures" / f"sweep-{source.name}")
    elif results is not None:
        with replaced_folder(results / sweep.name) as folder:
            shutil.copytree(directory.path / "report", folder, dirs_exist_ok=True)
            shutil.copyfile(directory.path / "provenance.json", folder / "provenance.json")


def field_importances(study: SweepStudy) -> dict[str, float]:
    """Field → importance for the first objective; none where there is too little to tell."""
    whole = {trial.values[0] for trial in study.finished}
    if len(study.sweep.space) < 2 or len(whole) < 2:
        return {}
    sign = -1 if MAXIMISED[study.sweep.objectives[0]] else 1  # it asks what makes the target low
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return get_param_importances(study.study, target=lambda trial: sign * trial.values[0])


def head_lines(sweep: SweepSpec, trials: Sequence[Plain]) -> Iterator[str]:
    spec = search_spec(sweep)
    given_up = sum(trial["pruned"] for trial in trials)
    seeds = f"{spec.seeds} seed{'s' if spec.seeds > 1 else ''}"
    yield f"# {sweep.title}"
    yield ""
    yield (
        f"Sweep `{sweep.name}` at {sweep.scale} scale over `{Path(sweep.base).stem}`: "
        f"{len(trials)} trials ({sweep.sampler}, {given_up} given up early), each on "
        f"{len(spec.tasks)} tasks × {seeds} × {spec.episodes} episodes. A gain is the mean score "
        "over No-Stitch's, paired by seed, task and episode under common random numbers; "
        "intervals are 95 %, from a hierarchical bootstrap over seeds, tasks and episodes. "
        f"{seed_note(spec.seeds)}"
    )
    yield ""


def confirm_lines(sweep: SweepSpec, best: Plain, confirmed: Plain) -> Iterator[str]:
    """The winner, and what is left of its gain where the search has never been."""
    yield "## Winner"
    yield ""
    yield f"Trial {best['trial']}: {best['setting']}. In the search: {_interval(best, 'gain')}."
    yield ""
    if not confirmed:
        yield (
            "It was not judged again: its gain is that of the best of many, and so too good. "
            "Set `confirm` to learn how much of it survives."
        )
        yield ""
        return
    spec, seeds = confirm_spec(sweep)
    rows, base = confirmed["trials"], confirmed["base"]
    where = "held-out tasks" if confirmed["held_out"] else "the search's own tasks"
    numbers = ", ".join(map(str, seeds))
    yield (
        f"Judged again on {len(spec.tasks)} {where} by new seeds ({numbers}; root seed "
        f"{spec.root_seed}), {spec.episodes} episodes each. {seed_note(len(seeds))}"
    )
    yield ""
    first = rows[0]
    found, again = f"{first['search_gain']:+.3f}", _interval(first, "gain")
    if first["gain"] <= 0:
        yield f"- Nothing of the winner's gain of {found} in the search survives: **{again}**."
    else:
        left = f"{again}{_share(first)}"
        yield f"- Of the winner's gain of {found} in the search, **{left} survives**."
    yield (
        f"- Over the base's own setting it gains **{_interval(first, 'over_base')}**; that one "
        f"gains {_interval(base, 'gain')} over No-Stitch ({base['no_stitch']:.3f})."
    )
    better = [row for row in rows[1:] if row["gain"] > first["gain"]]
    if better:
        yield (
            f"- Trial {better[0]['trial']} did better here. The winner stays the search's: one "
            "chosen by these episodes could not be judged by them."
        )
    yield ""
    yield "| Trial | Setting | Gain in the search | Gain here | Survives | Over the base's own |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for row in rows:
        cells = (
            row["trial"], row["setting"], f"{row['search_gain']:+.3f}", _interval(row, "gain"),
            _share(row).strip(" ()") or "–", _interval(row, "over_base"),
        )  # fmt: skip
        yield f"| {' | '.join(map(str, cells))} |"
    yield ""


def trial_lines(sweep: SweepSpec, ranked: Sequence[Plain]) -> Iterator[str]:
    """The best trials; with several objectives, the front that none of the others beats."""
    several = len(sweep.objectives) > 1
    shown = pareto_front(ranked) if several else ranked[:SHOWN]
    yield "## Pareto front" if several else "## Best trials in the search"
    yield ""
    yield f"| Trial | Setting | Gain | Score | No-Stitch | {LABELS['imagined'].capitalize()} |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for trial in shown:
        yield (
            f"| {trial['trial']} | {trial['setting']} | {_interval(trial, 'gain')} | "
            f"{trial['score']:.3f} | {trial['no_stitch']:.3f} | {trial['imagined']:,.0f} |"
        )
    yield ""


def importance_lines(importances: dict[str, float]) -> Iterator[str]:
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


def _share(row: Plain) -> str:
    """ " (80 %)": how much of the search's gain is left, where it had any."""
    return "" if row["survives"] is None else f" ({100 * max(0.0, row['survives']):.0f} %)"


def _interval(row: Plain, name: str) -> str:
    return f"{row[name]:+.3f} [{row[f'{name}_low']:+.3f}, {row[f'{name}_high']:+.3f}]"


def _flat(rows: Sequence[Plain]) -> pd.DataFrame:
    """One column a field, without the gains by task."""
    dropped = ("fields", "setting", "tasks")
    return pd.DataFrame(
        [
            {"trial": row["trial"], **row["fields"]}
            | {name: value for name, value in row.items() if name not in dropped}
            for row in rows
        ]
    )


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
