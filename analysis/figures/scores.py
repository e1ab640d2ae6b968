"""Our scores with their intervals beside the paper's, row by row."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.figures.style import FAINT, INK, looks, new_figure

WIDTH = 7.5  # inches
ROW_GAP = 1.5  # free height between rows, in units of one method's line
BELOW = 0.36  # of a mean are its seeds, in the same units
SEED: dict[str, Any] = {"marker": "o", "ms": 2.6, "mew": 0, "ls": "none", "alpha": 0.75}


def draw_scores(
    scores: pd.DataFrame, labels: Mapping[str, str], seed_scores: pd.DataFrame | None = None
) -> Figure:
    """One line a method within each row: filled with an interval is ours, hollow the paper's.

    scores: row, method, score, ci_low, ci_high, paper_score, as `scores.csv` has them too.
    labels: what methods are called. seed_scores: row, method, seed, score; drawn as small dots
    below the mean where there are several seeds.
    """
    methods, rows = (list(dict.fromkeys(scores[name])) for name in ("method", "row"))
    look_of, height = looks(methods), len(methods) + ROW_GAP
    figure = new_figure(WIDTH, 1.4 + 0.14 * height * len(rows))
    axes = figure.add_subplot()

    def at(cell: Mapping[Any, Any]) -> float:
        return rows.index(cell["row"]) * height + methods.index(cell["method"])

    for cell in scores.to_dict("records"):
        y, (colour, marker) = at(cell), look_of[cell["method"]]
        look: dict[str, Any] = {"color": colour, "marker": marker, "ls": "none", "clip_on": False}
        axes.plot([cell["ci_low"], cell["ci_high"]], [y, y], color=colour, lw=1.6)
        axes.plot(cell["score"], y, ms=5, **look)
        axes.plot(cell["paper_score"], y, ms=7.5, mfc="none", mew=1.1, **look)
    of_seeds = seed_scores.to_dict("records") if seed_scores is not None else []
    several = len({cell["seed"] for cell in of_seeds}) > 1
    for cell in of_seeds if several else []:
        colour, _ = look_of[cell["method"]]
        axes.plot(cell["score"], at(cell) + BELOW, color=colour, clip_on=False, **SEED)
    for row in range(1, len(rows)):
        axes.axhline(row * height - (1 + ROW_GAP) / 2, color=FAINT, lw=0.7)
    middle = (len(methods) - 1) / 2
    axes.set_yticks([row * height + middle for row in range(len(rows))], rows)
    axes.set_ylim(len(rows) * height - (1 + ROW_GAP) / 2, -(1 + ROW_GAP) / 2)
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, _upper_end(scores, [cell["score"] for cell in of_seeds]))
    axes.grid(axis="x", color=FAINT, lw=0.5)
    axes.set_axisbelow(True)
    axes.set_xlabel("score (accomplished skills / skills in the task)")
    keys = [
        Line2D([], [], color=colour, marker=marker, label=labels[method], ms=5)
        for method, (colour, marker) in look_of.items()
    ]
    if several:
        keys.append(Line2D([], [], color=INK, label="seeds", **SEED))
    if scores["paper_score"].notna().any():
        hollow: dict[str, Any] = {"marker": "o", "mfc": "none", "ms": 7.5, "ls": "none"}
        keys.append(Line2D([], [], color=INK, label="paper (hollow)", **hollow))
    letters = np.mean([len(str(key.get_label())) for key in keys])
    # Inches: of a key's line and the space after it, of a letter; no space after the last.
    columns = int((WIDTH + 0.15) / (0.5 + 0.075 * letters))
    figure.legend(handles=keys, loc="outside upper left", ncols=columns, columnspacing=1.2)
    return figure


def _upper_end(scores: pd.DataFrame, of_seeds: list[float]) -> float:
    """Scores start at 0; where all are low, the empty right-hand side is left away."""
    drawn = [0.1, *scores[["ci_high", "paper_score"]].to_numpy().ravel(), *of_seeds]
    return min(1.02, np.ceil(10 * np.nanmax(drawn) + 0.2) / 10)
