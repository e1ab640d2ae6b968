"""Figures of a sweep: history, importances, slices, Pareto front, and those of α × β."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.figures.drawn import Drawn
from analysis.figures.style import COLOURS, FAINT, INK, house_style, new_figure, save
from orchestrator.spec.structure import Plain
from sweeps.questions import METRICS
from sweeps.results.alpha_beta import ALPHA, BETA, alpha_beta, alpha_beta_tasks
from sweeps.results.axes import place, span
from sweeps.scoring import pareto_front
from sweeps.spec import SweepSpec

SAME = 1e-6  # scores closer than this are one

CAPTIONS = {
    "history": "Every trial, with its 95 % interval where it has one, and the best so far among "
    "those that were played in full and keep to the constraints.",
    "importances": "How much of what the good trials differ in each field explains (PED-ANOVA).",
    "slices": "Every trial against each searched field, later ones darker; crosses were given up.",
    "pareto": "Gain and what planning costs. Joined, with their numbers: the trials that no other "
    "one beats in both.",
    "alpha-beta": "The mean gain of each α and β, and the share of tasks that each pair helps.",
    "alpha-beta-tasks": "The gain of each α and β, task by task; the paper's where it prints them.",
}


def draw_figures(
    sweep: SweepSpec, trials: Sequence[Plain], importances: dict[str, float], folder: Path
) -> list[Drawn]:
    """Draw what there is something to show of."""
    figures: dict[str, Callable[[], Figure | None]] = {
        "history": lambda: history(sweep, trials),
        "importances": lambda: importance_bars(importances),
        "slices": lambda: slices(sweep, trials),
        "pareto": lambda: pareto(sweep, trials),
        "alpha-beta": lambda: alpha_beta(sweep, trials),
        "alpha-beta-tasks": lambda: alpha_beta_tasks(sweep, trials),
    }
    drawn = []
    with house_style():
        for name, draw in figures.items():
            figure = draw()
            if figure is not None:
                save(figure, folder, name)
                drawn.append(Drawn(name, CAPTIONS[name], table=""))
    return drawn


def history(sweep: SweepSpec, trials: Sequence[Plain]) -> Figure:
    """Every trial's gain (or misfit), and the best so far among those played in full."""
    main = sweep.question.main
    figure = new_figure(6.5, 3.2)
    axes = figure.subplots()
    for pruned, colour, label in ((False, COLOURS[0], "trial"), (True, FAINT, "given up")):
        some = [trial for trial in trials if trial["pruned"] == pruned]
        if some:
            axes.errorbar(
                [t["trial"] for t in some], [t[main] for t in some], _spread(some, main),
                fmt="o", ms=4, lw=0.8, color=colour, label=label,
            )  # fmt: skip
    whole = [trial for trial in trials if trial["feasible"] and not trial["pruned"]]
    if whole:
        better = np.maximum if METRICS[main].maximised else np.minimum
        best = better.accumulate([trial[main] for trial in whole])
        axes.step([t["trial"] for t in whole], best, where="post", color=COLOURS[3], label="best")
    axes.axhline(0, color=INK, lw=0.6)
    axes.set(xlabel="trial", ylabel=METRICS[main].label)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def _spread(trials: Sequence[Plain], metric: str) -> np.ndarray | None:
    """(2, trials) from a metric down and up to the ends of its interval, if it has one."""
    if f"{metric}_low" not in trials[0]:
        return None
    ends = np.array([[trial[f"{metric}_{end}"] for trial in trials] for end in ("low", "high")])
    return np.abs(ends - [trial[metric] for trial in trials])


def importance_bars(importances: dict[str, float]) -> Figure | None:
    """How much of the objective's variation among good trials each field explains (PED-ANOVA)."""
    if not importances:
        return None
    figure = new_figure(5.5, 0.8 + 0.3 * len(importances))
    axes = figure.subplots()
    names = list(reversed(importances))
    axes.barh([_label(name) for name in names], [importances[n] for n in names], color=COLOURS[0])
    axes.set(xlabel="importance (PED-ANOVA)", xlim=(0, 1))
    return figure


def slices(sweep: SweepSpec, trials: Sequence[Plain]) -> Figure:
    """Gain (or misfit) against each searched field, over the range that was searched."""
    main, paths = sweep.question.main, list(sweep.space)
    columns = min(3, len(paths))
    rows = -(-len(paths) // columns)
    figure = new_figure(2.6 * columns, 2.3 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes in grid.flat[len(paths) :]:
        axes.remove()
    norm = Normalize(0, max(trial["trial"] for trial in trials))
    for axes, path in zip(grid.flat, paths, strict=False):
        dimension = sweep.space[path]
        span(axes, "x", dimension)
        for pruned, look in (
            (False, {"marker": "o", "ec": INK, "lw": 0.4}),
            (True, {"marker": "x"}),
        ):
            some = [trial for trial in trials if trial["pruned"] == pruned]
            axes.scatter(
                [place(dimension, trial["fields"][path]) for trial in some],
                [trial[main] for trial in some],
                c=[trial["trial"] for trial in some], cmap="Blues", norm=norm, s=18, **look,
            )  # fmt: skip
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_xlabel(_label(path))
    numbers = [0.0, *(trial[main] for trial in trials)]
    if max(numbers) - min(numbers) < SAME:  # else the axis would show rounding errors
        grid[0, 0].set_ylim(min(numbers) - 0.05, max(numbers) + 0.05)
    for axes in grid[:, 0]:
        axes.set_ylabel(METRICS[main].label)
    return figure


def pareto(sweep: SweepSpec, trials: Sequence[Plain]) -> Figure | None:
    """Gain against what planning costs; the trials that no other one beats in both, joined."""
    kept = [trial for trial in trials if trial["feasible"] and not trial["pruned"]]
    if len(sweep.objectives) < 2 or not kept:
        return None
    front = sorted(pareto_front(kept), key=lambda trial: trial["imagined"])
    figure = new_figure(5, 3.4)
    axes = figure.subplots()
    axes.scatter([t["imagined"] for t in kept], [t["gain"] for t in kept], color=FAINT, s=18)
    axes.plot(
        [t["imagined"] for t in front], [t["gain"] for t in front], "o-", ms=4, color=COLOURS[0]
    )
    axes.margins(0.1)
    for trial in front:
        axes.annotate(
            str(trial["trial"]), (trial["imagined"], trial["gain"]), (-4, 4),
            textcoords="offset points", ha="right", fontsize=8,
        )  # fmt: skip
    axes.set(xlabel=METRICS["imagined"].label, ylabel=METRICS["gain"].label)
    return figure


def _label(path: str) -> str:
    return {ALPHA: "α", BETA: "β"}.get(path, path.removeprefix("mb_stitch."))
