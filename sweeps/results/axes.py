"""Axes of searched fields: each as wide as the range that was searched."""

from __future__ import annotations

from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from sweeps.space import Dimension, Value

ROOM = 0.05  # of the range, on either side


def span(axes: Axes, side: Literal["x", "y"], dimension: Dimension) -> None:
    """Set one axis to a dimension's range, with plain numbers for ticks."""
    axis = axes.xaxis if side == "x" else axes.yaxis
    shown: dict[str, Any] = {}
    if dimension.choices:
        names = list(map(str, dimension.choices))
        shown = {"ticks": range(len(names)), "ticklabels": names, "lim": (-0.5, len(names) - 0.5)}
    else:
        low, high = (float(end) for end in dimension.ends)
        room = (high / low) ** ROOM if dimension.log else ROOM * (high - low)
        ends = (low / room, high * room) if dimension.log else (low - room, high + room)
        shown = {"scale": "log" if dimension.log else "linear", "lim": ends}
    axes.set(**{f"{side}{name}": value for name, value in shown.items()})
    if dimension.log:
        axis.set_major_locator(LogLocator(subs=(1, 3)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    elif not dimension.choices:
        axis.set_major_locator(MaxNLocator(nbins=6, integer=dimension.integer))


def place(dimension: Dimension, value: Value) -> float:
    """Where a value lies on such an axis: of choices, its number."""
    return float(dimension.choices.index(value) if dimension.choices else value)
