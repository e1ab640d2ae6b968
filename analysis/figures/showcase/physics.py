"""One episode of simulated physics: its values step by step, and pictures of it."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from analysis.figures.style import COLOURS, FAINT, INK, new_figure
from analysis.schema import SEPARATOR, RunSpec

STITCH = "#E3001B"
BANDS = [colour for colour in COLOURS if colour != "#D55E00"]  # too near to STITCH
EQUAL_STEPS = 12  # frames of a sheet at equal steps
APART = 1 / 80  # of an episode; nearer to one another they show nothing new
COLUMNS = 4

Episode = Mapping[str, Any]
"""Of one method, by step (T,): positions (T, nq), skill, segment, phase, value, spread."""


def stretches(labels: Sequence[Any]) -> list[tuple[Any, int, int]]:
    """(label, first step, last step) of each run of equal labels."""
    runs = groupby(range(len(labels)), key=lambda step: labels[step])
    return [(label, (steps := list(run))[0], steps[-1]) for label, run in runs]


def stitches(episode: Episode) -> list[tuple[int, int]]:
    """(first step, last step) of each stitch; of two in a row each by itself."""
    steps = list(zip(segment_numbers(episode), episode["phase"], strict=True))
    return [(start, end) for (_, phase), start, end in stretches(steps) if phase == "stitch"]


def segment_numbers(episode: Episode) -> list[int]:
    """Which of the task's skills each step belongs to; in old recordings none is used twice."""
    if "segment" in episode:
        return list(episode["segment"])
    runs = enumerate(stretches(episode["skill"]))
    return [number for number, (_, start, end) in runs for _ in range(start, end + 1)]


def segment_labels(showcase: Mapping[str, Any], spec: RunSpec) -> list[str]:
    """The task's skills in words, numbered where one recurs."""
    skills = showcase["task"].split(SEPARATOR)
    return [
        f"{spec.skill_label(skill)} {skills[: place + 1].count(skill)}"
        if skills.count(skill) > 1
        else spec.skill_label(skill)
        for place, skill in enumerate(skills)
    ]


def draw_values(showcase: Mapping[str, Any], spec: RunSpec) -> Figure:
    """A panel for the first and the last method; a line breaks where another value takes over."""
    episodes = first_and_last(showcase)
    labels = segment_labels(showcase, spec)
    figure = new_figure(8.5, 0.9 + 2.1 * len(episodes))
    panels = figure.subplots(len(episodes), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, episode in zip(panels, episodes, strict=True):
        _draw_value(axes, episode)
        axes.set_title(_score(episode, showcase, spec), loc="left")
        axes.set_ylabel("value")
    panels[0].set_xlim(0, max(len(episode["value"]) for episode in episodes))
    panels[-1].set_xlabel("step")
    keys: list[Any] = [
        Patch(color=colour, alpha=0.5, lw=0, label=label)
        for colour, label in zip(BANDS, labels, strict=False)
    ]
    keys += [
        Patch(facecolor="white", edgecolor=STITCH, hatch="/////", lw=0, label="stitching"),
        Line2D([], [], color=INK, lw=1.4, label="value ± spread of the ensemble"),
    ]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), columnspacing=1.4)
    return figure


def first_and_last(showcase: Mapping[str, Any]) -> list[Episode]:
    """What is set against one another: the first method's episode and the last's."""
    episodes = showcase["episodes"]
    return [episodes[0], episodes[-1]] if len(episodes) > 1 else list(episodes)


def _score(episode: Episode, showcase: Mapping[str, Any], spec: RunSpec) -> str:
    method = spec.methods.get(episode["method"], episode["method"])
    return f"{method}: {episode['accomplished']} of {len(showcase['task'].split(SEPARATOR))} skills"


def headline(episode: Episode, showcase: Mapping[str, Any], spec: RunSpec) -> str:
    """Method, task and outcome, for a picture that is looked at alone."""
    method = spec.methods.get(episode["method"], episode["method"])
    skills = len(showcase["task"].split(SEPARATOR))
    return (
        f"{method}: {spec.task_label(showcase['task'])}, "
        f"{episode['accomplished']} of {skills} skills accomplished"
    )


def _draw_value(axes: Axes, episode: Episode) -> None:
    value, spread = np.array(episode["value"]), np.array(episode["spread"])
    for number, start, end in stretches(segment_numbers(episode)):
        steps = np.arange(start, end + 1)
        axes.axvspan(start, end + 1, color=BANDS[number], alpha=0.22, lw=0)
        # A step is as wide as its band: its value stands in the middle.
        low, high = (value - spread)[steps], (value + spread)[steps]
        axes.fill_between(steps + 0.5, low, high, color=INK, alpha=0.25, lw=0)
        axes.plot(steps + 0.5, value[steps], color=INK, lw=1.4)
    for start, end in stitches(episode):
        axes.axvspan(start, end + 1, facecolor="none", edgecolor=STITCH, hatch="/////", lw=0)
        steps = np.arange(start, end + 1)
        axes.plot(steps + 0.5, value[steps], color=STITCH, lw=2.4)
    axes.grid(axis="y", color=FAINT, lw=0.4)
    axes.set_axisbelow(True)


def sheet_steps(episode: Episode) -> list[int]:
    """Steps worth a picture: every stitch's first and last, every skill's last, some between."""
    last = len(episode["phase"]) - 1
    shown = {step for stitch in stitches(episode) for step in stitch}
    skill_ends = {end for _, _, end in stretches(segment_numbers(episode))}
    equal = np.linspace(0, last, min(EQUAL_STEPS, last + 1)).round().astype(int).tolist()
    for more in (skill_ends, set(equal)):
        shown |= {step for step in more if all(abs(step - at) > APART * last for at in shown)}
    return sorted(shown)


def draw_sheet(
    episode: Episode,
    steps: Sequence[int],
    frames: np.ndarray,
    labels: Sequence[str],
    heading: str,
) -> Figure:
    """frames: (N, height, width, 3), one for each of `steps`; stitching ones in a thick frame."""
    numbers = segment_numbers(episode)
    columns = min(COLUMNS, len(steps))
    rows = -(-len(steps) // columns)
    _, height, width, _ = frames.shape
    figure = new_figure(2.6 * columns, (2.6 * height / width + 0.25) * rows + 0.3)
    figure.suptitle(heading, x=0.005, ha="left", fontsize=11)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, step, frame in zip(grid, steps, frames, strict=False):
        stitching = episode["phase"][step] == "stitch"
        axes.imshow(frame)
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set(visible=True, color=STITCH if stitching else FAINT)
        axes.spines[:].set_linewidth(4 if stitching else 0.6)
        title = f"step {step}: {labels[numbers[step]]}"
        axes.set_title(
            f"{title}, stitch" if stitching else title,
            fontsize=9,
            color=STITCH if stitching else INK,
            fontweight="bold" if stitching else "normal",
        )
    for axes in grid[len(steps) :]:
        axes.set_visible(False)
    return figure
