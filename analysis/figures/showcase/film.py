"""A recorded episode as a film: every step a frame, with what is done and what it is worth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.figures.showcase.frames import render_frames
from analysis.figures.showcase.maze import draw_path_so_far
from analysis.figures.showcase.physics import STITCH, segment_labels, segment_numbers
from analysis.figures.showcase.scenes import NoPictureError, drawing_of, scene_of
from analysis.figures.style import INK, house_style
from analysis.files import replaced_file
from analysis.schema import RunSpec, kind_of

DPI = 100
WIDTH, CAPTION = 4.0, 0.5  # inches
LAST = 8  # times that the last frame is shown
STEPS_A_SECOND = {"physics": 12, "map": 4}


def write_film(showcase: Mapping[str, Any], spec: RunSpec, path: Path) -> None:
    """The showcase's last episode as an MP4 (H.264). NoPictureError where nothing can be drawn."""
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError:
        raise NoPictureError(
            "imageio-ffmpeg, which writes films, is not installed: pip install imageio-ffmpeg"
        ) from None
    draw, episode = drawing_of(FRAMES, showcase), showcase["episodes"][-1]
    with house_style():
        frames = list(draw(showcase, episode, spec))
    if not frames:
        raise NoPictureError("the episode has no step: its skill is accomplished as it begins")
    frames += [frames[-1]] * LAST
    height, width, _ = frames[0].shape
    with replaced_file(path) as draft:
        writer = imageio_ffmpeg.write_frames(
            str(draft),
            (width, height),
            fps=STEPS_A_SECOND[kind_of(showcase)],
            macro_block_size=2,
            output_params=["-f", "mp4"],  # whatever the draft's name ends with
        )
        try:
            writer.send(None)
            for frame in frames:
                writer.send(np.ascontiguousarray(frame))
            writer.close()
            written, _ = imageio_ffmpeg.count_frames_and_secs(str(draft))
        except (OSError, RuntimeError) as error:
            raise NoPictureError(f"the film could not be written: {error}") from error
        if written != len(frames):  # ffmpeg's exit status is not told
            raise NoPictureError(
                f"the film could not be written: {written} of {len(frames)} frames; is there room?"
            )


def _physics(
    showcase: Mapping[str, Any], episode: Mapping[str, Any], spec: RunSpec
) -> Iterator[np.ndarray]:
    pictures = render_frames(scene_of(showcase, episode), np.array(episode["positions"]))
    labels, numbers = segment_labels(showcase, spec), segment_numbers(episode)
    height, width, _ = pictures[0].shape
    for step, picture in enumerate(pictures):
        figure = Figure((WIDTH, WIDTH * height / width + CAPTION), dpi=DPI)
        axes = figure.add_axes((0, 0, 1, 1 - CAPTION / figure.get_figheight()))
        axes.imshow(picture)
        axes.set_axis_off()
        value, spread = episode["value"][step], episode["spread"][step]
        told = f"step {step + 1}: {labels[numbers[step]]}, value {value:.2f} ± {spread:.2f}"
        _caption(figure, _title(showcase, spec), told, episode["phase"][step])
        yield _pixels(figure)


def _map(
    showcase: Mapping[str, Any], episode: Mapping[str, Any], spec: RunSpec
) -> Iterator[np.ndarray]:
    for step in range(len(episode["phases"]) + 1):
        figure = Figure((WIDTH, WIDTH + CAPTION), dpi=DPI)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96 - CAPTION / figure.get_figheight()))
        draw_path_so_far(axes, showcase, episode, step)
        phase = episode["phases"][step - 1] if step else ""
        told = f"step {step}: {spec.skill_label(episode['skills'][step - 1])}" if step else "start"
        _caption(figure, _title(showcase, spec), told, phase)
        yield _pixels(figure)


FRAMES = {"physics": _physics, "map": _map}
"""How a kind of recording is drawn, step by step."""


def _title(showcase: Mapping[str, Any], spec: RunSpec) -> str:
    method = showcase["episodes"][-1]["method"]
    return f"{spec.methods.get(method, method)}: {spec.task_label(showcase['task'])}"


def _caption(figure: Figure, title: str, told: str, phase: str) -> None:
    """Two lines on top: the second one red and with the word where it is a stitch."""
    top = figure.get_figheight()
    stitching = phase == "stitch"
    figure.text(0.02, 1 - 0.16 / top, title, fontsize=8, va="center", color=INK)
    figure.text(
        0.02,
        1 - 0.37 / top,
        f"{told}, stitch" if stitching else told,
        fontsize=8,
        va="center",
        color=STITCH if stitching else INK,
        fontweight="bold" if stitching else "normal",
    )


def _pixels(figure: Figure) -> np.ndarray:
    """(height, width, 3) uint8."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]
