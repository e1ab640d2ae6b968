"""How training went: a small panel for each kind of model and curve, one line a training."""

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.figures.style import COLOURS, FAINT, new_figure

COLUMNS = 3


def draw_curves(training: list[dict[str, Any]]) -> Figure:
    """Lines of the same seed share a colour."""
    panels = list(
        dict.fromkeys((model["kind"], curve) for model in training for curve in model["curves"])
    )
    seeds = sorted({model["seed"] for model in training})
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(2.6 * columns, 0.5 + 1.9 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (kind, curve) in zip(grid, panels, strict=False):
        for model in training:
            points = model["curves"].get(curve, []) if model["kind"] == kind else []
            steps, values = zip(*points, strict=True) if points else ((), ())
            colour = COLOURS[seeds.index(model["seed"]) % len(COLOURS)]
            alone = "o" if len(points) == 1 else None  # a line of one point is not seen
            axes.plot(steps, values, color=colour, lw=1.1, alpha=0.85, marker=alone, ms=3.5)
        axes.set_title(f"{kind}: {curve.replace('_', ' ')}")
        axes.grid(color=FAINT, lw=0.4)
        axes.ticklabel_format(axis="x", style="sci", scilimits=(0, 4))
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    keys = [
        Line2D([], [], color=COLOURS[i % len(COLOURS)], label=f"seed {seed}")
        for i, seed in enumerate(seeds)
    ]
    figure.legend(handles=keys, loc="outside upper left", ncols=len(keys))
    figure.supxlabel("updates", fontsize=9)
    return figure
