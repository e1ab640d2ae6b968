"""Labelled episodes as a dataset."""

from dataclasses import replace

import numpy as np
import pytest

from stitching.data.own.labelled import are_labelled, labelled_data
from stitching.data.own.recording import Recording
from stitching.data.transitions import NO_SKILL, DataError, check
from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE

SHOWN = Recording(np.arange(24.0).reshape(4, 6), np.eye(4)[[0, 1, 2]], "g2")


def test_episodes_are_kept_as_they_are() -> None:
    shorter = Recording(SHOWN.observations[:2], SHOWN.actions[:1], "g0", success=False)
    data = labelled_data("mine", [SHOWN, shorter, replace(SHOWN, skill="")], MAZE)
    check(data, MAZE, "mine")
    assert data.episode_ends.tolist() == [3, 4, 7]
    assert data.episode_skills.tolist() == [2, 0, NO_SKILL]
    assert data.episode_successes.tolist() == [True, False, False]
    np.testing.assert_array_equal(data.observations[:3], SHOWN.observations[:3])
    np.testing.assert_array_equal(data.next_observations[:3], SHOWN.observations[1:])
    np.testing.assert_array_equal(data.actions[:3], SHOWN.actions)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (replace(SHOWN, skill="g9"), "mine, episode 1: skill 'g9'; expected one of g0, g1, g2, g3"),
        (replace(SHOWN, skill=None), "mine, episode 1: no skill is said; expected one of g0"),
        (
            replace(SHOWN, actions=np.full((3, 4), 0.25)),
            r"mine, episode 1: actions, row 0 of the episode: \[0.25 .*expected one 1 among zeros",
        ),
        (
            replace(SHOWN, actions=np.eye(4)[[0, 1, 2]] * [[1], [0], [1]]),
            "episode 1: actions, row 1",
        ),
    ],
)
def test_what_is_none_of_the_benchmark_s_is_told(wrong: Recording, told: str) -> None:
    with pytest.raises(DataError, match=told):
        labelled_data("mine", [SHOWN, wrong], MAZE)


def test_actions_out_of_range_are_told() -> None:
    actions = np.zeros((3, 9))
    actions[2, 4] = 1.5
    shown = Recording(np.zeros((4, 59)), actions, "kettle")
    with pytest.raises(DataError, match=r"episode 0: actions, row 2 .*numbers in \[-1, 1\]"):
        labelled_data("mine", [shown], KITCHEN)


def test_data_that_show_no_skill_teach_none() -> None:
    with pytest.raises(DataError, match="mine: no episode shows a skill"):
        labelled_data("mine", [replace(SHOWN, skill="")], MAZE)


def test_who_says_nothing_has_no_labels() -> None:
    assert are_labelled([SHOWN, replace(SHOWN, skill=None)])
    assert not are_labelled([replace(SHOWN, skill=None)])
