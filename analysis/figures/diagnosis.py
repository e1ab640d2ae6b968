"""Whether the dynamics and the values are right, on data that no model was trained on."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from analysis.figures.style import COLOURS, FAINT, INK, MARKERS, hide_unused, new_figure
from analysis.schema import RunSpec

COLUMNS = 4


def draw_predictions(predictions: Mapping[str, Any]) -> Figure:
    """Left errors by group, then disagreement against error for each number of steps."""
    figure = new_figure(3.6 + 2.6 * len(predictions), 3.1)
    panels = figure.subplots(
        1, 1 + len(predictions), squeeze=False, width_ratios=[1.15, *[1] * len(predictions)]
    )[0]
    _draw_errors(panels[0], predictions)
    for axes, (steps, study), colour in zip(panels[1:], predictions.items(), COLOURS, strict=False):
        spread, error = np.array(study["points"]).T
        axes.loglog(spread, error, ".", color=colour, ms=3.5, mew=0, alpha=0.5)
        axes.set_title(f"after {_steps(steps)}: {_rho(study['disagreement_rank_correlation'])}")
        axes.grid(color=FAINT, lw=0.4)
        axes.set_axisbelow(True)
        axes.set_xlabel("disagreement of the ensemble")
    panels[1].set_ylabel("error of its mean")
    _same_scale(panels[1:], [study["points"] for study in predictions.values()])
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=9)
    return figure


def _same_scale(panels: Sequence[Axes], points: Sequence[Any]) -> None:
    """The same limits for all, and numbers at 1 and 3 times powers of ten."""
    all_points = np.concatenate(points)
    low = np.array([column[column > 0].min(initial=1.0) for column in all_points.T]) / 1.3
    high = all_points.max(axis=0) * 1.3
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 3)))
            axis.set_major_formatter(FuncFormatter(lambda number, _: f"{number:g}"))
            axis.set_minor_locator(NullLocator())


def _steps(steps: str) -> str:
    return "1 step" if steps == "1" else f"{steps} steps"


def _rho(correlation: float) -> str:
    return f"ρ = {correlation:.2f}".replace("-", "−")


def _draw_errors(axes: Axes, predictions: Mapping[str, Any]) -> None:
    groups = list(dict.fromkeys(g for study in predictions.values() for g in study["groups"]))
    for (steps, study), colour, marker in zip(predictions.items(), COLOURS, MARKERS, strict=False):
        relative = [study["groups"][group]["relative"] for group in groups]
        axes.plot(relative, groups, marker, color=colour, ms=6, label=_steps(steps))
    axes.axvline(1, color=INK, lw=0.8, ls="--")
    axes.invert_yaxis()
    axes.margins(y=0.15)
    axes.set_xlim(0, max(1.1, 1.05 * axes.get_xlim()[1]))
    axes.grid(color=FAINT, lw=0.4)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("error / distance moved")
    axes.set_title("error of predictions")


def draw_value_curves(values: Mapping[str, Any], spec: RunSpec) -> Figure:
    """A panel for each skill: E[V] along its held-out demonstrations, from start to end."""
    skills = [skill for skill in spec.skills if skill in values]
    columns = min(COLUMNS, len(skills))
    rows = -(-len(skills) // columns)
    figure = new_figure(2.3 * columns, 0.4 + 1.9 * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes, skill, colour in zip(grid, skills, COLOURS, strict=False):
        study = values[skill]
        mean, spread = np.array(study["mean"]), np.array(study["spread"])
        progress = np.linspace(0, 1, len(mean))
        for curve in study["curves"]:
            axes.plot(progress, curve, color=colour, lw=0.5, alpha=0.4)
        axes.fill_between(progress, mean - spread, mean + spread, color=colour, alpha=0.3, lw=0)
        axes.plot(progress, mean, color=colour, lw=2.2)
        axes.set_title(f"{spec.skill_label(skill)}: {_rho(study['rank_correlation'])}")
        axes.grid(color=FAINT, lw=0.4)
        axes.set_axisbelow(True)
    hide_unused(grid, len(skills), columns)
    figure.supxlabel("progress through the demonstration", fontsize=9)
    figure.supylabel("value", fontsize=9)
    return figure
