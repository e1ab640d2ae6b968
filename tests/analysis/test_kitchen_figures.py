import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.figures import frames
from analysis.figures.frames import NoPictureError, render_frames
from analysis.figures.kitchen import EQUAL_STEPS, sheet_steps, stitches, stretches
from tests.analysis.kitchen_run import kitchen_episode


def test_stretches_keep_their_order_and_ends() -> None:
    assert stretches(["a", "a", "b", "a"]) == [("a", 0, 1), ("b", 2, 2), ("a", 3, 3)]


def test_a_sheet_shows_both_ends_of_every_stitch() -> None:
    episode = kitchen_episode("mb-stitch", True)
    assert stitches(episode) == [(20, 24)]
    steps = sheet_steps(episode)
    assert {0, 20, 24, 49} <= set(steps)
    assert steps == sorted(set(steps))
    assert len(sheet_steps(kitchen_episode("no-stitch", False))) == EQUAL_STEPS


def test_two_stitches_in_a_row_are_two() -> None:
    episode = {"skill": ["a", "b", "b"], "phase": ["stitch"] * 3}
    assert stitches(episode) == [(0, 0), (1, 2)]


def test_a_very_short_episode_has_a_sheet() -> None:
    assert sheet_steps({"skill": ["a"], "phase": ["execute"]}) == [0]


def test_frames_show_the_positions_and_are_always_the_same() -> None:
    start = np.array(kitchen_episode("mb-stitch", True)["positions"][0])
    opened = start.copy()
    opened[22] = -0.75  # the microwave's door
    try:
        first, second = render_frames(np.stack([start, opened])), render_frames(start[None])
    except NoPictureError as error:
        pytest.skip(str(error))
    assert first.dtype == np.uint8
    assert first[0].std() > 20  # no blank picture
    np.testing.assert_array_equal(first[0], second[0])
    assert 0.005 < (first[0] != first[1]).any(axis=-1).mean() < 0.5


def test_without_a_backend_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "BACKENDS", ("no-such-backend",))
    with pytest.raises(NoPictureError, match="install libegl1 or libosmesa6"):
        render_frames(np.zeros((1, 30)))


def test_without_mujoco_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stub = tmp_path / "python"
    stub.write_text(
        "#!/bin/sh\necho \"ModuleNotFoundError: No module named 'mujoco'\" >&2\nexit 1\n"
    )
    stub.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stub))
    with pytest.raises(NoPictureError, match="mujoco is not installed"):
        render_frames(np.zeros((1, 30)))


def test_without_the_model_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> Any:
        return None

    monkeypatch.setattr(frames, "find_spec", nothing)
    with pytest.raises(NoPictureError, match="gymnasium-robotics"):
        render_frames(np.zeros((1, 30)))
