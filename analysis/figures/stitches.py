"""When stitching hurts: every stitch from four sides, coloured by what came of it."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.figures.style import COLOURS, FAINT, INK, new_figure
from analysis.studies.stitches import Study, begun, gains, label, of_parts, outcome

BLUE, _, GREEN, RED, _, _, GREY = COLOURS
LOOKS = {
    "helped": (GREEN, "^"),
    "hurt": (RED, "v"),
    "succeeded either way": (BLUE, "o"),
    "failed either way": (GREY, "x"),
}
ORDER = ("failed either way", "succeeded either way", "helped", "hurt")  # on top at last


def draw_outcomes(studies: Mapping[str, Study]) -> Figure:
    """A row of four panels for each part and kind of stitches that has any."""
    shown = {label(part, kind): study for part, kind, study in of_parts(studies) if begun(study)}
    figure = new_figure(12.4, 0.6 + 3.0 * len(shown))
    grid = figure.subplots(len(shown), len(PANELS), squeeze=False)
    for row, (name, study) in zip(grid, shown.items(), strict=True):
        for axes, (title, draw) in zip(row, PANELS.items(), strict=True):
            axes.grid(color=FAINT, lw=0.4)
            axes.set_axisbelow(True)
            axes.set_title(title)
            draw(axes, study)
        row[0].set_ylabel(f"{name}\n{row[0].get_ylabel()}")
    _legend(figure, shown)
    return figure


def _legend(figure: Figure, studies: Mapping[str, Study]) -> None:
    found = [outcome(stitch) for study in studies.values() for stitch in begun(study)]
    handles = [
        Line2D([], [], color=colour, marker=marker, lw=1.2, ms=5, label=f"{name} ({count})")
        for name, (colour, marker) in LOOKS.items()
        if (count := found.count(name))
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def _by_outcome(study: Study) -> list[tuple[str, str, list[Any]]]:
    """(colour, marker, stitches) of each outcome, those to be seen best last."""
    stitches = begun(study)
    return [(*LOOKS[name], [s for s in stitches if outcome(s) == name]) for name in ORDER]


def _values(axes: Axes, study: Study) -> None:
    for colour, marker, stitches in _by_outcome(study):
        for stitch in stitches:
            value = stitch["value"]
            axes.plot(value, color=colour, lw=0.9, alpha=0.6)
            axes.plot(len(value) - 1, value[-1], marker, color=colour, ms=4.5, alpha=0.8)
    axes.set_xlabel("stitching step")
    axes.set_ylabel("value of the skill to come")


def _scatter(axes: Axes, study: Study, points: Callable[[Any], np.ndarray]) -> None:
    """points: of one stitch, (n, 2)."""
    for colour, marker, stitches in _by_outcome(study):
        if stitches:
            x, y = np.concatenate([points(stitch) for stitch in stitches]).T
            axes.plot(x, y, marker, color=colour, ms=4.5, alpha=0.65, ls="none")


def _diagonal(axes: Axes) -> None:
    """Where both axes say the same."""
    axes.axline((0, 0), slope=1, color=INK, lw=0.8, ls="--", zorder=1)


def _distances(axes: Axes, study: Study) -> None:
    _scatter(axes, study, lambda stitch: np.array(stitch["distance"])[None, [0, -1]])
    _same_limits(axes, from_zero=True)
    _diagonal(axes)
    known = [d for d in study["typical_distance"].values() if d is not None]
    if known:
        axes.axhline(float(np.mean(known)), color=INK, lw=0.8, ls=":")
    axes.set_xlabel("before the stitch")
    axes.set_ylabel("after it")


def _gains(axes: Axes, study: Study) -> None:
    _scatter(axes, study, gains)
    _same_limits(axes)
    _diagonal(axes)
    axes.set_xlabel("predicted")
    axes.set_ylabel("realised")


def _variances(axes: Axes, study: Study) -> None:
    def mean(stitch: Any) -> np.ndarray:
        terms = [[plan["spread"], plan["disagreement"]] for plan in stitch["plans"]]
        return np.mean(terms, axis=0, keepdims=True)

    _scatter(axes, study, mean)
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("spread of values")
    axes.set_ylabel("spread of dynamics")


def _same_limits(axes: Axes, *, from_zero: bool = False) -> None:
    low = min(axes.get_xlim()[0], axes.get_ylim()[0])
    high = max(axes.get_xlim()[1], axes.get_ylim()[1])
    axes.set(xlim=(0 if from_zero else low, high), ylim=(0 if from_zero else low, high))


PANELS: dict[str, Callable[[Axes, Study], None]] = {
    "value along each stitch": _values,
    "distance to that skill's data": _distances,
    "gain in value by one action": _gains,
    "the two variances of Eq. 2": _variances,
}
