"""The task that a run shows, as pictures: what happened in an episode, and what it was worth."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.figures.drawn import DRAWING, PHOTOGRAPH, Drawn
from analysis.figures.showcase.frames import render_frames
from analysis.figures.showcase.maze import draw_showcase
from analysis.figures.showcase.physics import (
    draw_sheet,
    draw_values,
    headline,
    segment_labels,
    sheet_steps,
)
from analysis.figures.showcase.scenes import (
    VIEWS,
    NoPictureError,
    drawing_of,
    scene_of,
)
from analysis.figures.style import house_style, save
from analysis.run import Run
from analysis.schema import RunSpec

SHOWCASE_CAPTION = (
    "As Figure 1 of the paper: demonstrated skills (left), then whole episodes, the skill in "
    "charge by colour, stitching dashed. Paths are drawn a little apart."
)
VALUES_CAPTION = (
    "The same episode by both methods: the value of the skill in charge (background), ensemble "
    "mean ± spread over its members. The line breaks where the next skill's value takes over; "
    "stitching is hatched and red."
)
SHEET_CAPTION = (
    "The episode above under {method}: frames at equal steps, every skill's last step, and every "
    "stitch's first and last step, framed in red."
)


@dataclass(frozen=True)
class _Shown:
    """The showcase of a run, or of one of the runs that were merged."""

    part: str  # of a merged run; else ""
    showcase: dict[str, Any]
    spec: RunSpec

    def name(self, figure: str) -> str:
        return f"{figure}-{self.part}" if self.part else figure

    def drawn(
        self,
        figure: str,
        caption: str,
        missing: str = "",
        formats: tuple[str, ...] = DRAWING,
    ) -> Drawn:
        where = f"{self.part}: " if self.part and caption else ""
        return Drawn(self.name(figure), where + caption, "", missing, formats)


def draw_showcases(run: Run, folder: Path) -> list[Drawn]:
    """Of every part, or of the run itself."""
    drawn = []
    for part, showcase in run.showcases.items():
        shown = _Shown(part, showcase, run.spec)
        try:
            draw = drawing_of(SHOWCASES, showcase)
        except NoPictureError as error:
            drawn.append(shown.drawn("showcase", "", f"no picture: {error}"))
        else:
            drawn += draw(shown, folder)
    return drawn


def _map(shown: _Shown, folder: Path) -> list[Drawn]:
    save(draw_showcase(shown.showcase, shown.spec.methods), folder, shown.name("showcase"))
    return [shown.drawn("showcase", SHOWCASE_CAPTION)]


def _physics(shown: _Shown, folder: Path) -> list[Drawn]:
    save(draw_values(shown.showcase, shown.spec), folder, shown.name("stitch-values"))
    values = shown.drawn("stitch-values", f"{VALUES_CAPTION} {_which_episode(shown)}")
    return [values, _contact_sheet(shown, folder)]


def _contact_sheet(shown: _Shown, folder: Path) -> Drawn:
    showcase, episode = shown.showcase, shown.showcase["episodes"][-1]
    try:
        sheet = _sheet(showcase, shown.spec)
    except NoPictureError as error:
        return shown.drawn("contact-sheet", "", f"no contact sheet: {error}")
    save(sheet, folder, shown.name("contact-sheet"), PHOTOGRAPH)
    method = shown.spec.methods.get(episode["method"], episode["method"])
    caption = f"{SHEET_CAPTION.format(method=method)} {VIEWS[showcase['benchmark']].note}"
    return shown.drawn("contact-sheet", caption.strip(), formats=PHOTOGRAPH)


def _sheet(showcase: dict[str, Any], spec: RunSpec) -> Figure:
    """The last episode's contact sheet."""
    episode = showcase["episodes"][-1]
    steps = sheet_steps(episode)
    frames = render_frames(scene_of(showcase, episode), np.array(episode["positions"])[steps])
    heading = headline(episode, showcase, spec)
    return draw_sheet(episode, steps, frames, segment_labels(showcase, spec), heading)


def _path(showcase: dict[str, Any], spec: RunSpec) -> Figure:
    """The last episode's path on the map."""
    last = {"demonstrations": {}, "episodes": showcase["episodes"][-1:]}
    return draw_showcase(showcase | last, spec.methods)


def write_picture(showcase: dict[str, Any], spec: RunSpec, path: Path) -> None:
    """The last episode in one PNG: a contact sheet, or its path. NoPictureError as frames do."""
    with house_style():
        save(drawing_of(PICTURES, showcase)(showcase, spec), path.parent, path.stem, ("png",))


def _which_episode(shown: _Shown) -> str:
    """How the shown episode was chosen, as `stitching.studies.showcase.physics` does."""
    showcase, spec = shown.showcase, shown.spec
    names = [episode["method"] for episode in showcase["episodes"]]
    first, last = (spec.methods.get(name, name) for name in (names[0], names[-1]))
    scores = [showcase["accomplished_by_all"][name] for name in (names[0], names[-1])]
    better = sum(b > a for a, b in zip(*scores, strict=True))
    played = f"{spec.task_label(showcase['task'])}, {showcase['of_episodes']} episodes played"
    if not better:
        return (
            f"{played}: {last} accomplishes more than {first} in none; shown is the first in which "
            "it accomplishes most."
        )
    return f"{played}: {last} accomplishes more than {first} in {better}; the first of them."


SHOWCASES = {"map": _map, "physics": _physics}
"""How a kind of recording is drawn."""

PICTURES = {"map": _path, "physics": _sheet}
"""How an episode of it is drawn in one picture."""
