"""Our scores with their intervals beside the paper's, row by row."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.figures.style import FAINT, INK, looks, new_figure
from analysis.tables.table import Table

WIDTH = 7.5  # inches
ROW_GAP = 1.5  # free height between rows, in units of one method's line


def draw_scores(table: Table) -> Figure:
    """One line a method within each row: filled with an interval is ours, hollow the paper's."""
    methods, rows, look_of = table.methods, table.rows, looks(table.methods)
    height = len(methods) + ROW_GAP
    figure = new_figure(WIDTH, 1.4 + 0.14 * height * len(rows))
    axes = figure.add_subplot()
    for cell in table.scores.to_dict("records"):
        place = methods.index(cell["method"])
        y = rows.index(cell["row"]) * height + place
        colour, marker = look_of[cell["method"]]
        look: dict[str, Any] = {"color": colour, "marker": marker, "ls": "none"}
        axes.plot([cell["ci_low"], cell["ci_high"]], [y, y], color=colour, lw=1.6)
        axes.plot(cell["score"], y, ms=5, **look)
        axes.plot(cell["paper_score"], y, ms=7.5, mfc="none", mew=1.1, **look)
    for row in range(1, len(rows)):
        axes.axhline(row * height - (1 + ROW_GAP) / 2, color=FAINT, lw=0.7)
    middle = (len(methods) - 1) / 2
    axes.set_yticks([row * height + middle for row in range(len(rows))], rows)
    axes.set_ylim(len(rows) * height - (1 + ROW_GAP) / 2, -(1 + ROW_GAP) / 2)
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, _upper_end(table))
    axes.grid(axis="x", color=FAINT, lw=0.5)
    axes.set_axisbelow(True)
    axes.set_xlabel("score (accomplished skills / skills in the task)")
    _legend(figure, table)
    return figure


def _upper_end(table: Table) -> float:
    """Scores start at 0; where all are low, the empty right-hand side is left away."""
    highest = np.nanmax([0.1, *table.scores[["ci_high", "paper_score"]].to_numpy().ravel()])
    return min(1.02, np.ceil(10 * highest + 0.2) / 10)


def _legend(figure: Figure, table: Table) -> None:
    keys = [
        Line2D([], [], color=colour, marker=marker, label=table.labels[method], ms=5)
        for method, (colour, marker) in looks(table.methods).items()
    ]
    if table.scores["paper_score"].notna().any():
        hollow: dict[str, Any] = {"marker": "o", "mfc": "none", "ms": 7.5, "ls": "none"}
        keys.append(Line2D([], [], color=INK, label="paper (hollow)", **hollow))
    letters = np.mean([len(str(key.get_label())) for key in keys])
    columns = int(WIDTH / (0.5 + 0.075 * letters))  # inches of a key's line and of a letter
    figure.legend(handles=keys, loc="outside upper left", ncols=columns, columnspacing=1.2)
