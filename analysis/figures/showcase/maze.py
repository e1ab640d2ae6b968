"""The paper's Figure 1: skills, a direct chain, and a stitched episode, on our maze."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from analysis.figures.style import COLOURS, INK, SMALLEST, new_figure

WALL = "#BFC4CA"


def draw_showcase(showcase: Mapping[str, Any], labels: Mapping[str, str]) -> Figure:
    """Left the demonstrated skills, where there are any, then a panel for each episode given."""
    episodes, demonstrations = showcase["episodes"], showcase["demonstrations"]
    colours = dict(zip(showcase["goals"], COLOURS, strict=False))
    count = len(episodes) + bool(demonstrations)
    figure = new_figure(max(5.5, 3.1 * count), 3.9)
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes in panels:
        _draw_map(axes, showcase, colours)

    if demonstrations:
        panels[0].set_title("Skills")
    for skill, paths in demonstrations.items():
        for path in paths:
            _draw_path(panels[0], path, colours[skill], "-", _lane(skill, colours))
    for axes, episode in zip(panels[-len(episodes) :], episodes, strict=True):
        _draw_episode(axes, episode, colours)
        method = labels.get(episode["method"], episode["method"])
        skills = episode["task"].split(">")
        axes.set_title(f"{method}: {episode['accomplished']} of {len(skills)} skills")
        axes.set_xlabel(" → ".join(skills))

    keys = [Line2D([], [], color=colour, lw=2.2, label=skill) for skill, colour in colours.items()]
    keys += [
        Line2D([], [], color=INK, lw=2.2, label="execute"),
        Line2D([], [], color=INK, lw=2.2, ls=(0, (1.5, 1)), label="stitch"),
        Line2D([], [], color=INK, marker="s", ls="none", label="start"),
        Line2D([], [], color=INK, marker="X", ls="none", label="end of the episode"),
    ]
    columns = len(keys) if count > 2 else 4
    figure.legend(handles=keys, loc="outside lower center", ncols=columns, columnspacing=1.2)
    return figure


def draw_path_so_far(
    axes: Axes, showcase: Mapping[str, Any], episode: Mapping[str, Any], steps: int
) -> None:
    """An episode after so many steps."""
    colours = dict(zip(showcase["goals"], COLOURS, strict=False))
    _draw_map(axes, showcase, colours)
    taken = {name: episode[name][:steps] for name in ("phases", "skills")}
    _draw_episode(axes, taken | {"positions": episode["positions"][: steps + 1]}, colours)


def _draw_map(axes: Axes, showcase: Mapping[str, Any], colours: Mapping[str, str]) -> None:
    walls = np.array([[cell == "#" for cell in row] for row in showcase["layout"]])
    for row, column in np.argwhere(walls):
        axes.add_patch(_square(row, column, WALL))
    for goal, (row, column) in showcase["goals"].items():
        axes.add_patch(_square(row, column, colours[goal], alpha=0.3))
        axes.text(
            column + 0.45, row - 0.45, goal, ha="right", va="top", fontsize=SMALLEST, zorder=4
        )
    row, column = showcase["spawn"]
    axes.plot(column, row, "s", color=INK, ms=6, zorder=3)
    height, width = walls.shape
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[])
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)


def _square(row: int, column: int, colour: str, alpha: float = 1.0) -> Rectangle:
    return Rectangle((column - 0.5, row - 0.5), 1, 1, color=colour, alpha=alpha, lw=0)


def _draw_episode(axes: Axes, episode: Mapping[str, Any], colours: Mapping[str, str]) -> None:
    """Positions are (T + 1, 2), phases and skills (T,): one colour a skill, stitches dashed."""
    steps = enumerate(zip(episode["skills"], episode["phases"], strict=True))
    for (skill, phase), run in groupby(steps, key=lambda step: step[1]):
        times = [time for time, _ in run]
        path = episode["positions"][times[0] : times[-1] + 2]
        style: Any = (0, (1.5, 1)) if phase == "stitch" else "-"
        _draw_path(axes, path, colours[skill], style, _lane(skill, colours))
    row, column = episode["positions"][-1]
    axes.plot(column, row, "X", color=INK, ms=7, zorder=5, mec="white", mew=0.8)


def _lane(skill: str, colours: Mapping[str, str]) -> float:
    """A small offset for each skill, so that paths through the same cells stay visible."""
    return 0.13 * (list(colours).index(skill) - (len(colours) - 1) / 2)


def _draw_path(
    axes: Axes, path: Sequence[Sequence[float]], colour: str, style: Any, lane: float
) -> None:
    rows, columns = np.array(path, dtype=float).T + lane
    axes.plot(columns, rows, color=colour, ls=style, lw=2.2, zorder=2)
