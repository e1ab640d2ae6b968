"""Pairs foretold from held-out demonstrations."""

from dataclasses import replace

import numpy as np
import pytest

from stitching.data.transitions import Transitions
from stitching.envs.kitchen import IDLE, KITCHEN
from stitching.models.scale import observation_scale
from stitching.studies.forecast import configuration, pair_forecast

NAMES = [skill.name for skill in KITCHEN.skills]
FIRST, SECOND, THIRD = NAMES[:3]
OWN = {skill: {"successes": 3, "trials": 4} for skill in NAMES}
POSE = KITCHEN.factors.pose[0]
SHUT = KITCHEN.factors.objects["hinge cabinet"].positions[0]
UNSEEN = KITCHEN.factors.objects["kettle"].velocities[0]
STARTS = {FIRST: (0.0, 0.0), SECOND: (1.0, 0.0), THIRD: (1.0, 3.0)}  # of pose and object
ENDS = {FIRST: (1.0, 0.0), SECOND: (5.0, 0.0), THIRD: (0.0, 0.0)}


def shown() -> Transitions:
    """Two demonstrations of each of three skills, of one step each, that differ in a velocity."""
    skills = np.repeat(np.arange(3), 2)
    states = np.zeros((2, len(skills), KITCHEN.observation_size), dtype=np.float32)
    for row, skill in enumerate(skills):
        for moment, places in zip(states, (STARTS, ENDS), strict=True):
            moment[row, [POSE, SHUT]] = places[NAMES[skill]]
            moment[row, UNSEEN] = row
    return Transitions(
        observations=states[0],
        actions=np.zeros((len(skills), KITCHEN.actions.size), dtype=np.float32),
        next_observations=states[1],
        episode_ends=np.arange(1, len(skills) + 1),
        episode_skills=skills,
        episode_successes=np.ones(len(skills), dtype=bool),
    )


def test_a_pair_without_a_gap_works_as_often_as_the_second_skill_alone() -> None:
    data = shown()
    foretold = {(one["first"], one["second"]): one for one in pair_forecast(KITCHEN, data, OWN)}
    assert foretold[FIRST, SECOND]["distance"] == 0
    assert foretold[FIRST, SECOND]["success"] == pytest.approx(3 / 4)
    columns = configuration(KITCHEN.factors)
    deviation = observation_scale(data.observations)[1]
    gap = 3 / deviation[SHUT] / len(columns) ** 0.5  # the third's object stands elsewhere
    assert foretold[FIRST, THIRD]["distance"] == pytest.approx(gap, rel=1e-5)
    assert foretold[FIRST, THIRD]["success"] == pytest.approx(3 / 4 * np.exp(-gap), rel=1e-5)


def test_each_end_is_measured_to_its_nearest_start_and_then_averaged() -> None:
    """Three demonstrations of the first skill, of two steps; the one that failed does not count."""
    poses = [[0, 8, 1], [0, 8, 4], [0, 8, 9], [2, 8, 8], [5, 8, 8]]  # of each: before, between, end
    states = np.zeros((5, 3, KITCHEN.observation_size), dtype=np.float32)
    states[:, :, POSE] = poses
    data = Transitions(
        observations=states[:, :2].reshape(10, -1),
        actions=np.zeros((10, KITCHEN.actions.size), dtype=np.float32),
        next_observations=states[:, 1:].reshape(10, -1),
        episode_ends=np.arange(2, 12, 2),
        episode_skills=np.array([0, 0, 0, 1, 1]),
        episode_successes=np.array([True, True, False, True, True]),
    )
    unit = np.std([0, 8, 0, 8, 0, 8, 2, 8, 5, 8]) * len(configuration(KITCHEN.factors)) ** 0.5
    (found,) = [one for one in pair_forecast(KITCHEN, data, OWN) if one["first"] == FIRST]
    # From 1 to the start at 2, and from 4 to the one at 5.
    assert found["distance"] == pytest.approx(1 / unit, rel=1e-5)
    assert found["success"] == pytest.approx(3 / 4 * np.exp(-1 / unit), rel=1e-5)
    states[1, 2, POSE] = 7
    farther = replace(data, next_observations=states[:, 1:].reshape(10, -1))
    (found,) = [one for one in pair_forecast(KITCHEN, farther, OWN) if one["first"] == FIRST]
    both = (np.exp(-1 / unit) + np.exp(-2 / unit)) / 2
    assert found["success"] == pytest.approx(3 / 4 * both, rel=1e-5)
    assert found["distance"] == pytest.approx(1.5 / unit, rel=1e-5)


def test_every_ordered_pair_of_skills_that_were_shown_and_succeeded() -> None:
    data = shown()
    assert len(pair_forecast(KITCHEN, data, OWN)) == 3 * 2
    missed = replace(data, episode_successes=data.episode_skills != 2)
    assert {one["second"] for one in pair_forecast(KITCHEN, missed, OWN)} == {FIRST, SECOND}
    untried = {skill: OWN[skill] for skill in (FIRST, SECOND)}
    assert {one["second"] for one in pair_forecast(KITCHEN, data, untried)} == {FIRST, SECOND}


def test_what_no_skill_is_about_is_no_part_of_a_configuration() -> None:
    """Of such an object only noise is seen, which its small deviation would make large."""
    columns = configuration(KITCHEN.factors)
    assert set(KITCHEN.factors.pose) <= set(columns)
    assert not {column for name in IDLE for column in KITCHEN.factors.objects[name].columns} & set(
        columns
    )
    assert {KITCHEN.factors.objects[skill.name].positions[0] for skill in KITCHEN.skills} <= set(
        columns
    )
