"""Figures of a sweep: history, importances, slices, Pareto front, α × β over tasks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis.figures.style import COLOURS, FAINT, INK, house_style, new_figure, save
from analysis.paper.numbers import paper_scores
from orchestrator.spec.structure import Plain
from sweeps.questions import METRICS
from sweeps.scoring import pareto_front
from sweeps.spec import SweepSpec

ALPHA, BETA = "mb_stitch.alpha", "mb_stitch.beta"
MOST_PANELS = 12  # tasks that get a heat map of their own


def draw_figures(
    sweep: SweepSpec, trials: Sequence[Plain], importances: dict[str, float], folder: Path
) -> list[str]:
    """Draw what there is something to show of; returns the names of the files, without suffix."""
    drawn: dict[str, Callable[[], Figure | None]] = {
        "history": lambda: history(sweep, trials),
        "importances": lambda: importance_bars(importances),
        "slices": lambda: slices(sweep, trials),
        "pareto": lambda: pareto(sweep, trials),
        "alpha-beta": lambda: alpha_beta(sweep, trials),
        "alpha-beta-tasks": lambda: alpha_beta_tasks(sweep, trials),
    }
    names = []
    with house_style():
        for name, draw in drawn.items():
            figure = draw()
            if figure is not None:
                save(figure, folder, name)
                names.append(name)
    return names


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
    axes.legend()
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
    """Gain (or misfit) against each searched field, later trials darker."""
    paths = list(sweep.space)
    columns = min(3, len(paths))
    rows = -(-len(paths) // columns)
    figure = new_figure(2.6 * columns, 2.3 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes in grid.flat[len(paths) :]:
        axes.remove()
    numbers = [trial[sweep.question.main] for trial in trials]
    for axes, path in zip(grid.flat, paths, strict=False):
        dimension = sweep.space[path]
        values = [trial["fields"][path] for trial in trials]
        if dimension.choices:
            values = [dimension.choices.index(value) for value in values]
            axes.set_xticks(range(len(dimension.choices)), list(map(str, dimension.choices)))
        elif dimension.log:
            axes.set_xscale("log")
        axes.scatter(values, numbers, c=range(len(trials)), cmap="Blues", ec=INK, lw=0.4, s=18)
        axes.axhline(0, color=INK, lw=0.6)
        axes.set_xlabel(_label(path))
    for axes in grid[:, 0]:
        axes.set_ylabel(sweep.question.main)
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
    for trial in front:
        axes.annotate(str(trial["trial"]), (trial["imagined"], trial["gain"]), fontsize=7)
    axes.set(xlabel=METRICS["imagined"].label, ylabel=METRICS["gain"].label)
    return figure


def alpha_beta(sweep: SweepSpec, trials: Sequence[Plain]) -> Figure | None:
    """Over all tasks: mean gain of each pair, and the share of tasks that it helps."""
    if not {ALPHA, BETA} <= set(sweep.space):
        return None
    helped = [float(np.mean([g > 0 for g in trial["tasks"].values()])) for trial in trials]
    gains = [trial["gain"] for trial in trials]
    figure = new_figure(7.5, 3.4)
    left, right = figure.subplots(1, 2)
    _pairs(figure, left, sweep, trials, gains, "mean gain")
    _pairs(figure, right, sweep, trials, helped, "share of tasks with a gain", low=0, high=1)
    return figure


def alpha_beta_tasks(sweep: SweepSpec, trials: Sequence[Plain]) -> Figure | None:
    """One heat map a task, where a grid has few enough of them; the paper's below ours."""
    if not _is_grid(sweep):
        return None
    tasks = list(trials[0]["tasks"])
    if not 1 < len(tasks) <= MOST_PANELS:
        return None
    panels = {_row(task): [trial["tasks"][task] for trial in trials] for task in tasks}
    panels |= paper_gains(sweep, trials, list(panels))
    columns = min(4, len(tasks))
    rows = -(-len(panels) // columns)
    figure = new_figure(2.9 * columns, 2.8 * rows)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(panels) :]:
        axes.remove()
    most = max(abs(gain) for gains in panels.values() for gain in gains) or 1.0
    for axes, (title, gains) in zip(grid.flat, panels.items(), strict=False):
        _pairs(figure, axes, sweep, trials, gains, title, low=-most, high=most)
    return figure


def paper_gains(
    sweep: SweepSpec, trials: Sequence[Plain], rows: Sequence[str]
) -> dict[str, list[float]]:
    """Title of a heat map → the printed gain over No-Stitch at each trial's setting."""
    printed = paper_scores(sweep.tables[0].paper) if sweep.tables else {}
    wanted = ["no-stitch", *(trial["method"] for trial in trials)]
    return {
        f"the paper's:\n{row}": [
            printed[row, trial["method"]][0] - printed[row, "no-stitch"][0] for trial in trials
        ]
        for row in rows
        if all((row, method) in printed for method in wanted)
    }


def _row(task: str) -> str:
    return task.replace(">", " → ")


def _pairs(
    figure: Figure,
    axes: Axes,
    sweep: SweepSpec,
    trials: Sequence[Plain],
    shown: Sequence[float],
    title: str,
    low: float | None = None,
    high: float | None = None,
) -> None:
    """A number for every (α, β): cells of a grid, or else points on logarithmic axes."""
    most = max(map(abs, shown)) or 1.0
    norm = Normalize(-most if low is None else low, most if high is None else high)
    colours = "cividis" if low == 0 else "RdBu"
    image: ScalarMappable
    alphas = [trial["fields"][ALPHA] for trial in trials]
    betas = [trial["fields"][BETA] for trial in trials]
    if _is_grid(sweep):
        frame = pd.DataFrame({"alpha": alphas, "beta": betas, "shown": shown})
        cells = frame.pivot_table(index="alpha", columns="beta", values="shown", aggfunc="mean")
        image = axes.imshow(cells, cmap=colours, norm=norm, origin="lower", aspect="auto")
        axes.set_xticks(range(len(cells.columns)), [f"{beta:g}" for beta in cells.columns])
        axes.set_yticks(range(len(cells.index)), [f"{alpha:g}" for alpha in cells.index])
        for (row, column), value in np.ndenumerate(cells.to_numpy()):
            text = f"{value:.2f}" if low == 0 else f"{value:+.2f}"
            dark = np.mean(image.get_cmap()(norm(value))[:3]) < 0.45
            axes.text(column, row, text, ha="center", va="center", fontsize=8,
                      color="white" if dark else INK)  # fmt: skip
    else:
        image = axes.scatter(betas, alphas, c=shown, cmap=colours, norm=norm, ec=INK, lw=0.4, s=24)
        axes.set(xscale=_scale(sweep, BETA), yscale=_scale(sweep, ALPHA))
    axes.set(xlabel="β", ylabel="α", title=title)
    figure.colorbar(image, ax=axes)


def _is_grid(sweep: SweepSpec) -> bool:
    return sweep.sampler == "grid" and {ALPHA, BETA} <= set(sweep.space)


def _scale(sweep: SweepSpec, path: str) -> str:
    return "log" if sweep.space[path].log else "linear"


def _label(path: str) -> str:
    return {ALPHA: "α", BETA: "β"}.get(path, path.removeprefix("mb_stitch."))
