"""Figures of α × β: what each pair gains over all tasks, and task by task beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from analysis.figures.style import INK, new_figure
from analysis.paper.numbers import paper_scores
from orchestrator.spec.structure import Plain
from sweeps.results.axes import place, span
from sweeps.spec import SweepSpec

ALPHA, BETA = "mb_stitch.alpha", "mb_stitch.beta"
MOST_PANELS = 12  # tasks that get a heat map of their own


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
    """A number for every (α, β): cells of a grid, or else points over the ranges searched."""
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
            rounded = round(value, 2) + 0.0  # no -0.00
            text = f"{rounded:.2f}" if low == 0 else f"{rounded:+.2f}"
            dark = np.mean(image.get_cmap()(norm(value))[:3]) < 0.5
            axes.text(column, row, text, ha="center", va="center", fontsize=8,
                      color="white" if dark else INK)  # fmt: skip
    else:
        span(axes, "x", sweep.space[BETA])
        span(axes, "y", sweep.space[ALPHA])
        image = axes.scatter(
            [place(sweep.space[BETA], beta) for beta in betas],
            [place(sweep.space[ALPHA], alpha) for alpha in alphas],
            c=shown, cmap=colours, norm=norm, ec=INK, lw=0.4, s=24,
        )  # fmt: skip
    axes.set(xlabel="β", ylabel="α", title=title)
    figure.colorbar(image, ax=axes)


def _is_grid(sweep: SweepSpec) -> bool:
    return sweep.sampler == "grid" and {ALPHA, BETA} <= set(sweep.space)
