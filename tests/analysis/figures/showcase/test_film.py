"""Films of recorded episodes: every step a frame, under a caption."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest

from analysis.figures.showcase import film, showcases
from analysis.figures.showcase.film import LAST, write_film
from analysis.figures.showcase.scenes import NoPictureError
from analysis.figures.showcase.showcases import write_picture
from analysis.run import Run, load_run
from tests.analysis.kitchen_run import write_kitchen


@pytest.fixture
def kitchen(tmp_path: Path, write_run: Callable[..., Path]) -> Run:
    return load_run(write_kitchen(write_run, tmp_path / "run"))


def grey(scene: Any, positions: np.ndarray) -> np.ndarray:
    return np.full((len(positions), 30, 40, 3), 90, dtype=np.uint8)


def test_every_step_is_a_frame(
    kitchen: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "render_frames", grey)
    showcase = kitchen.showcases[""]
    write_film(showcase, kitchen.spec, tmp_path / "film.mp4")
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.mp4"))
    assert frames == len(showcase["episodes"][-1]["phase"]) + LAST
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["film.mp4"]


def test_stitches_are_told_in_red(kitchen: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "render_frames", grey)
    showcase = kitchen.showcases[""]
    episode = showcase["episodes"][-1]
    red = [
        bool(((frame[:50, :, 0] > 180) & (frame[:50, :, 1] < 90)).any())
        for frame in film.FRAMES["physics"](showcase, episode, kitchen.spec)
    ]
    assert red == [phase == "stitch" for phase in episode["phase"]]
    assert any(red)
    assert not all(red)


def test_nothing_is_left_where_nothing_can_be_drawn(
    kitchen: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(scene: Any, positions: np.ndarray) -> np.ndarray:
        raise NoPictureError("MuJoCo cannot draw here")

    monkeypatch.setattr(film, "render_frames", refuse)
    monkeypatch.setattr(showcases, "render_frames", refuse)
    for write in (write_film, write_picture):
        with pytest.raises(NoPictureError):
            write(kitchen.showcases[""], kitchen.spec, tmp_path / "film.mp4")
    assert not list(tmp_path.glob("film*"))
