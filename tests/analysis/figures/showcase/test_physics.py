import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.backends import PLATFORMS
from analysis.figures.showcase import frames, scenes
from analysis.figures.showcase.frames import render_frames
from analysis.figures.showcase.physics import (
    EQUAL_STEPS,
    draw_sheet,
    headline,
    segment_labels,
    segment_numbers,
    sheet_steps,
    stitches,
    stretches,
)
from analysis.figures.showcase.scenes import VIEWS, NoPictureError, scene_of
from analysis.schema import RunSpec
from tests.analysis.kitchen_run import kitchen_episode, kitchen_spec

# A body that the model has at the origin, one that falls freely, a shape that is not for the eye.
MODEL = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="door"><geom type="box" size=".1 .1 .1" rgba="1 0 0 1" group="1"/></body>
    <body name="can"><freejoint/><geom type="sphere" size=".1" rgba="0 0 1 1" group="1"/></body>
    <geom type="sphere" size=".1" pos="0 .3 0" rgba="0 1 0 1" group="0"/>
  </worldbody>
</mujoco>
"""
CAMERA = {"lookat": (0, 0, 0), "distance": 2, "azimuth": 0, "elevation": -20}
SCENE = {"path": "", "xml": MODEL, "camera": CAMERA, "visual_only": True, "fixtures": {}}
BESIDE = [0, -0.4, 0, 1, 0, 0, 0]  # a pose: m, w x y z


def kitchen_scene() -> dict[str, Any]:
    return scene_of({"benchmark": "kitchen"}, {})


def spec() -> RunSpec:
    return RunSpec.from_dict(kitchen_spec())


def drawn(scene: dict[str, Any], positions: Sequence[Sequence[float] | np.ndarray]) -> np.ndarray:
    try:
        return render_frames(scene, np.array(positions))
    except NoPictureError as error:
        pytest.skip(str(error))


def test_stretches_keep_their_order_and_ends() -> None:
    assert stretches(["a", "a", "b", "a"]) == [("a", 0, 1), ("b", 2, 2), ("a", 3, 3)]


def test_a_sheet_shows_both_ends_of_every_stitch() -> None:
    episode = kitchen_episode("mb-stitch", True)
    assert stitches(episode) == [(20, 24)]
    steps = sheet_steps(episode)
    assert {0, 20, 24, 49} <= set(steps)
    assert steps == sorted(set(steps))
    plain = sheet_steps(kitchen_episode("no-stitch", False))
    assert 19 in plain  # the first skill's last
    assert len(plain) == EQUAL_STEPS + 1


def test_two_stitches_in_a_row_are_two() -> None:
    episode = {"skill": ["a", "b", "b"], "phase": ["stitch"] * 3}
    assert stitches(episode) == [(0, 0), (1, 2)]


def test_a_very_short_episode_has_a_sheet() -> None:
    assert sheet_steps({"skill": ["a"], "phase": ["execute"]}) == [0]


def test_of_a_long_episode_no_two_pictures_show_the_same() -> None:
    """The skill's last step is next to the stitch's first."""
    skill, phase = ["a"] * 150 + ["b"] * 150, ["execute"] * 150 + ["stitch"] * 20
    steps = sheet_steps({"skill": skill, "phase": phase + ["execute"] * 130})
    assert {0, 150, 169, 299} <= set(steps)
    assert np.diff(steps).min() > 3


def test_a_skill_used_twice_is_two() -> None:
    episode = {"skill": ["can"] * 4, "segment": [0, 0, 1, 1], "phase": ["execute"] * 4}
    assert segment_numbers(episode) == [0, 0, 1, 1]
    assert segment_labels({"task": "can>can"}, spec()) == ["can 1", "can 2"]
    assert segment_labels({"task": "open>close"}, spec()) == ["open", "close"]


def test_old_recordings_tell_their_skills_by_name() -> None:
    assert segment_numbers({"skill": ["b", "b", "a"]}) == [0, 0, 1]


def test_a_sheet_names_what_it_shows() -> None:
    episode = {"segment": [0, 1, 1], "phase": ["execute", "stitch", "execute"]}
    pictures = np.zeros((3, 6, 8, 3), np.uint8)
    figure = draw_sheet(episode, [0, 1, 2], pictures, ["can 1", "can 2"], "MB-Stitch: can → can")
    assert figure.get_suptitle() == "MB-Stitch: can → can"
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["step 0: can 1", "step 1: can 2, stitch", "step 2: can 2"]


def test_a_sheet_says_method_task_and_outcome() -> None:
    episode = kitchen_episode("mb-stitch", False)
    said = headline(episode, {"task": "microwave>kettle>hinge cabinet"}, spec())
    assert said == "MB-Stitch: microwave → kettle → hinge cabinet, 1 of 3 skills accomplished"


def test_bodies_stand_where_the_episode_had_them() -> None:
    moved = SCENE | {"fixtures": {"door": [0, 0.3, 0, 1, 0, 0, 0]}}
    first, second = drawn(SCENE, [BESIDE])[0], drawn(moved, [BESIDE])[0]
    middle, right = red(first), red(second)
    assert abs(middle - 200) < 3  # of 400 pixels
    assert abs(right - 200) > 30


def red(frame: np.ndarray) -> float:
    """Where the red is, in pixels from the left."""
    colour = frame.astype(int)
    return float(np.nonzero(colour[..., 0] > 2 * colour[..., 1] + 20)[1].mean())


def test_what_is_not_for_the_eye_is_not_shown() -> None:
    def green(scene: dict[str, Any]) -> bool:
        colour = drawn(scene, [BESIDE])[0].astype(int)
        return bool((colour[..., 1] > 2 * colour[..., 0] + 20).any())

    assert not green(SCENE)
    assert green(SCENE | {"visual_only": False})


def test_a_recording_without_its_model_says_so() -> None:
    with pytest.raises(NoPictureError, match="run it again"):
        scene_of({"benchmark": "robosuite-door"}, {})


def test_a_benchmark_that_nobody_looked_at_says_so() -> None:
    with pytest.raises(NoPictureError, match="no view of juggling"):
        scene_of({"benchmark": "juggling"}, {})


@pytest.mark.parametrize("benchmark", ["robosuite-door", "robosuite-can"])
def test_a_model_is_told_with_its_episode(benchmark: str) -> None:
    scene = scene_of({"benchmark": benchmark, "model": MODEL}, {"fixtures": {"door": BESIDE}})
    assert (scene["xml"], scene["fixtures"]) == (MODEL, {"door": BESIDE})
    assert scene["camera"]["distance"] == VIEWS[benchmark].camera.distance


def test_frames_show_the_positions_and_are_always_the_same() -> None:
    start = np.array(kitchen_episode("mb-stitch", True)["positions"][0])
    opened = start.copy()
    opened[22] = -0.75  # the microwave's door
    scene = kitchen_scene()
    first, second = drawn(scene, [start, opened]), drawn(scene, [start])
    assert first.dtype == np.uint8
    assert first[0].std() > 20  # no blank picture
    np.testing.assert_array_equal(first[0], second[0])
    assert 0.005 < (first[0] != first[1]).any(axis=-1).mean() < 0.5


def test_without_a_backend_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PLATFORMS, "no-such-backend", "none")
    monkeypatch.setattr(frames, "backends", lambda: ["no-such-backend"])
    with pytest.raises(NoPictureError, match="install libegl1 or libosmesa6"):
        render_frames(SCENE, np.zeros((1, 7)))


def test_without_mujoco_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stub = tmp_path / "python"
    stub.write_text(
        "#!/bin/sh\necho \"ModuleNotFoundError: No module named 'mujoco'\" >&2\nexit 1\n"
    )
    stub.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(stub))
    with pytest.raises(NoPictureError, match="mujoco is not installed"):
        render_frames(SCENE, np.zeros((1, 7)))


def test_without_the_model_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> Any:
        return None

    monkeypatch.setattr(scenes, "find_spec", nothing)
    with pytest.raises(NoPictureError, match="gymnasium-robotics"):
        kitchen_scene()
