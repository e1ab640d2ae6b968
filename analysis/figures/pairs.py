"""Which second skill works after which first: one matrix a method."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch, Rectangle

from analysis.figures.style import INK, SMALLEST, new_figure
from analysis.schema import SEPARATOR, RunSpec
from analysis.studies.pairs import second_skills

BLANK: dict[str, Any] = {"facecolor": "#F4F4F4", "edgecolor": "#C4C4C4", "hatch": "////", "lw": 0}
NO_EPISODE = "no episode: not asked for, or the first skill never succeeded"
FRAME = "#FF3D8B"  # apart from every colour of the map


def pair_rates(segments: pd.DataFrame, spec: RunSpec, method: str) -> np.ndarray:
    """(first, second) success rate of the second skill given the first's; NaN if never tried."""
    seconds = second_skills(segments, spec)
    rates = seconds[seconds["method"] == method].groupby("task")["success"].mean()
    pairs = [[SEPARATOR.join((first, second)) for second in spec.skills] for first in spec.skills]
    return np.array([[rates.get(pair, np.nan) for pair in row] for row in pairs], dtype=float)


def draw_pairs(
    segments: pd.DataFrame,
    spec: RunSpec,
    methods: tuple[str, str],
    framed: Collection[tuple[str, str]] = (),
) -> Figure:
    """Two matrices side by side, rows the first skill, columns the second.

    `framed` are the pairs (first, second) to put a frame around.
    """
    figure, panels = two_panels(spec)
    for axes, method in zip(panels, methods, strict=True):
        image = draw_matrix(axes, pair_rates(segments, spec, method), spec)
        _frame(axes, spec, framed)
        axes.set_title(spec.methods[method])
    panels[1].set_yticks(range(len(spec.skills)), [])
    panels[0].set_ylabel("first skill, accomplished")
    keys = [Patch(label="in the data, one right after the other", fill=False, ec=FRAME, lw=2)]
    blank = any(np.isnan(pair_rates(segments, spec, method)).any() for method in methods)
    explain(figure, (keys if framed else []) + ([blank_key(NO_EPISODE)] if blank else []))
    bar = figure.colorbar(image, ax=panels, shrink=0.8, label="success of the second skill")
    bar.outline.set_visible(False)
    return figure


def two_panels(spec: RunSpec) -> tuple[Figure, np.ndarray]:
    """A figure with room for two matrices of the spec's skills, and its axes (2,)."""
    size = 1.3 + 0.46 * len(spec.skills)
    figure = new_figure(2 * size + 1.2, size + 0.6)
    return figure, figure.subplots(1, 2)


def blank_key(why: str) -> Patch:
    """Of cells without a number."""
    return Patch(label=why, **BLANK)


def explain(figure: Figure, keys: Sequence[Patch]) -> None:
    """What stands out in a matrix, below it."""
    if keys:
        figure.legend(handles=keys, loc="outside lower left", ncols=len(keys))


def draw_matrix(axes: Axes, rates: np.ndarray, spec: RunSpec) -> AxesImage:
    """Rates (first, second) in [0, 1], each with its number; NaN is hatched."""
    names = [spec.skill_label(skill) for skill in spec.skills]
    axes.patch.set(**BLANK)
    image = axes.imshow(rates, vmin=0, vmax=1, cmap="cividis")
    for (row, column), rate in np.ndenumerate(rates):
        dark = rate < 0.5
        text = "" if np.isnan(rate) else f"{rate:.2f}"
        axes.text(column, row, text, ha="center", va="center", fontsize=SMALLEST,
                  color="white" if dark else INK)  # fmt: skip
    axes.set_xticks(range(len(names)), names)
    if max(map(len, names)) > 4:
        axes.tick_params(axis="x", labelrotation=40)
        for label in axes.get_xticklabels():
            label.set(ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("second skill")
    return image


def _frame(axes: Axes, spec: RunSpec, pairs: Collection[tuple[str, str]]) -> None:
    """A line inside each pair's cell."""
    for first, second in pairs:
        corner = spec.skills.index(second) - 0.44, spec.skills.index(first) - 0.44
        axes.add_patch(Rectangle(corner, 0.88, 0.88, fill=False, ec=FRAME, lw=2))
