"""Performance profiles: the share of runs with a score above each threshold, by method."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.figures.style import FAINT, hide_unused, looks, new_figure
from analysis.tables.distribution import THRESHOLDS
from analysis.tables.table import Table

COLUMNS = 4


def draw_distributions(table: Table) -> Figure:
    """A panel for each row with many tasks, of which there is one at least."""
    rows = list(dict.fromkeys(row for row, _ in table.distributions))
    look_of = looks(table.methods)
    columns = min(COLUMNS, len(rows))
    lines = -(-len(rows) // columns)
    figure = new_figure(max(5.0, 0.5 + 2.4 * columns), 0.9 + 2.2 * lines)
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axes, row in zip(grid, rows, strict=False):
        for method, of in ((m, of) for (name, m), of in table.distributions.items() if name == row):
            colour, _ = look_of[method]
            axes.step(THRESHOLDS, of.share, where="post", color=colour, lw=1.6)
            axes.fill_between(
                THRESHOLDS, of.share_low, of.share_high, step="post", color=colour, alpha=0.2, lw=0
            )
        axes.set_title(row)
        axes.set(xlim=(0, 1), ylim=(0, 1.02), xticks=[0, 0.5, 1])
        axes.grid(color=FAINT, lw=0.4)
        axes.set_axisbelow(True)
    hide_unused(grid, len(rows), columns)
    keys = [
        Line2D([], [], color=look_of[method][0], lw=1.6, label=table.labels[method])
        for method in table.methods
    ]
    figure.legend(handles=keys, loc="outside upper left", ncols=min(4, len(keys)))
    figure.supxlabel("score τ", fontsize=9)
    figure.supylabel("share of runs with a score above τ", fontsize=9)
    return figure
