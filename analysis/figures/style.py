"""What all figures share: colours, fonts, and files whose bytes depend on the content alone."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from analysis.figures.drawn import DRAWING

# Okabe and Ito's palette, told apart by colour-blind readers; black and yellow left out.
COLOURS = ["#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#7F7F7F"]
MARKERS = ["o", "s", "^", "D", "v", "P", "X", "<", ">", "*"]
METHODS = (
    "no-stitch", "random-stitch", "mf-stitch", "mb-stitch", "single-policy", "reach-stitch",
)  # fmt: skip
"""Each has its colour and marker in every figure, by its place here."""

INK, FAINT = "#222222", "#D0D0D0"
SMALLEST = 7.5  # points; pages keep letters of this size legible

SETTINGS: dict[Any, Any] = {
    "svg.hashsalt": "skillstitch",  # element ids in SVG files are random otherwise
    "svg.fonttype": "path",  # letters look the same on machines with other fonts
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "figure.facecolor": "white",
}


OPTIONS: dict[str, dict[str, Any]] = {
    "svg": {"dpi": 100, "metadata": {"Date": None, "Creator": None}},
    "png": {"dpi": 144, "metadata": {"Software": None}},
}


def looks(methods: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Method → colour and marker: its own; others, and further settings of one, what is left."""
    places: dict[str, int] = {}
    for method in methods:
        base = re.split(r"[\[@]", method)[0]
        if base in METHODS and METHODS.index(base) not in places.values():
            places[method] = METHODS.index(base)
    left = (place for place in count() if place not in set(places.values()))
    for method in methods:
        if method not in places:
            places[method] = next(left)
    return {
        method: (COLOURS[place % len(COLOURS)], MARKERS[place % len(MARKERS)])
        for method, place in places.items()
    }


@contextmanager
def house_style() -> Iterator[None]:
    """Inside, matplotlib draws as configured here, whatever the user's own settings are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(SETTINGS)
        yield


def new_figure(width: float, height: float) -> Figure:
    """A figure in inches that belongs to no window and no global list of figures."""
    return Figure(figsize=(width, height), layout="constrained")


def hide_unused(grid: np.ndarray, used: int, columns: int) -> None:
    """Of panels that share their axes, row by row: the lowest of each column has its numbers."""
    for axes in grid[used:]:
        axes.set_visible(False)
    for axes in grid[max(0, used - columns) : used]:
        axes.tick_params(labelbottom=True)


def save(figure: Figure, folder: Path, name: str, formats: tuple[str, ...] = DRAWING) -> None:
    """Writes <name>.<format> for each; the same figure gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in formats:
        figure.savefig(folder / f"{name}.{each}", **OPTIONS[each])
