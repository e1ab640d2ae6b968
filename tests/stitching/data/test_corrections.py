"""Corrective labels: consistent with how the robot moves, and only before it moves an object."""

from dataclasses import replace

import numpy as np
import pytest

from stitching.data.corrections import STEPS_BACK, Corrections
from stitching.streams import stream
from tests.stitching.data.made_up import DATA, EFFECT, FACTORS, SAG, SKILLS

CORRECTIONS = Corrections.of(DATA, FACTORS, SKILLS, 1.5)
ROWS = np.arange(len(DATA)).repeat(20)
DRAWN = CORRECTIONS.draw(ROWS, DATA.actions[ROWS], stream("displacements"))
DISPLACED = DRAWN.now.any(axis=1)


def test_the_data_say_how_actions_move_the_robot() -> None:
    assert CORRECTIONS.pose.tolist() == [0, 1]  # no action moves the finger
    known = CORRECTIONS.robot.tolist()
    assert known == [0, 1, 3, 4]
    assert CORRECTIONS.effect[:2] == pytest.approx(EFFECT, abs=1e-4)
    assert CORRECTIONS.drift[:2] == pytest.approx(-SAG * np.eye(2), abs=1e-4)
    changes = (DATA.next_observations - DATA.observations)[CORRECTIONS.free][:, :2]
    assert CORRECTIONS.deviations == pytest.approx(1.5 * np.sqrt((changes**2).mean(axis=0)))


def test_a_displaced_transition_is_one_that_the_robot_could_have_made() -> None:
    states = DATA.observations[ROWS] + DRAWN.now
    actions = DATA.actions[ROWS] + DRAWN.actions
    following = DATA.next_observations[ROWS] + DRAWN.following
    expected = (1 - SAG) * states[:, :2] + actions @ EFFECT.T
    assert following[:, :2] == pytest.approx(expected, abs=1e-4)
    assert np.abs(actions).max() <= 1 + 1e-6


def test_a_third_of_the_way_back_where_the_action_allows_it() -> None:
    inside = (np.abs(DATA.actions[ROWS] + DRAWN.actions) < 0.999).all(axis=1) & DISPLACED
    assert inside.sum() > 1000
    remaining = DRAWN.following[inside][:, :2]
    share = 1 - SAG - 1 / STEPS_BACK
    assert remaining == pytest.approx(share * DRAWN.now[inside][:, :2], abs=1e-4)


def test_only_the_robot_and_only_before_it_moves_the_object() -> None:
    free = CORRECTIONS.free
    assert not DRAWN.now[:, [2, 3, 4, 5, 6]].any()
    assert not DRAWN.following[:, [2, 5, 6]].any()
    assert not DRAWN.actions[~DISPLACED].any()
    assert not DRAWN.following[~DISPLACED].any()
    assert not DISPLACED[~free[ROWS]].any()
    assert DISPLACED[free[ROWS]].mean() == pytest.approx(0.5, abs=0.03)
    assert DRAWN.now[DISPLACED][:, :2].std(axis=0) == pytest.approx(CORRECTIONS.deviations, rel=0.1)


def test_all_that_is_drawn_lies_in_the_widened_range() -> None:
    both = np.concatenate([DATA.observations, DATA.next_observations])
    low, high = CORRECTIONS.widened(both.min(axis=0), both.max(axis=0))
    drawn = [DATA.observations[ROWS] + DRAWN.now, DATA.next_observations[ROWS] + DRAWN.following]
    for states in drawn:
        assert (states >= low - 1e-6).all()
        assert (states <= high + 1e-6).all()
    assert (drawn[0][:, :2] < both.min(axis=0)[:2]).any()  # what the range of the data would cut
    as_seen = [2, 5, 6]  # the finger and the objects
    assert np.array_equal(low[as_seen], both.min(axis=0)[as_seen])
    assert np.array_equal(high[as_seen], both.max(axis=0)[as_seen])


def test_a_robot_that_does_not_do_as_it_is_told_is_refused() -> None:
    shuffled = stream("shuffled").permutation(len(DATA))
    deaf = replace(DATA, actions=DATA.actions[shuffled])
    still = replace(deaf, next_observations=stream("noise").normal(size=(len(DATA), 7)))
    with pytest.raises(ValueError, match="do not tell how actions move the robot"):
        Corrections.of(still, FACTORS, SKILLS, 1.0)
