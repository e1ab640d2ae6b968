"""Objects swapped in minibatches: only those that play no part, whole, and from one state."""

import numpy as np
import pytest

from stitching.data.swapping import Swapping, bystanders
from stitching.data.transitions import Transitions, concatenate
from stitching.envs.factors import NO_OBJECT, Factors, Object
from stitching.streams import stream

# A robot (0), a door's position and velocity (1, 3), a cup (2), and what belongs to nothing (4).
FACTORS = Factors(
    (0,), {"door": Object((1,), (3,)), "cup": Object((2,))}, own={"open": "door", "fill": "cup"}
)
SKILLS = ("open", "fill", "wave")
STEPS = 6


def made_up(skill: int, moving: tuple[int, ...] = (), seed: int = 0) -> Transitions:
    """One episode in which these columns move, and the others stand still somewhere."""
    states = np.repeat(stream("start", skill, seed).normal(size=(1, 5)), STEPS + 1, axis=0)
    states[:, list(moving)] += np.linspace(0, 3, STEPS + 1)[:, None]
    states = states.astype(np.float32)
    return Transitions(
        states[:-1],
        np.zeros((STEPS, 1), dtype=np.float32),
        states[1:],
        np.array([STEPS]),
        np.array([skill]),
        np.array([True]),
    )


DATA = concatenate(
    [
        made_up(0, (0, 1)),  # opens the door
        made_up(0, (0, 1, 2), seed=1),  # opens the door, and moves the cup by accident
        made_up(1, (0, 2)),  # fills the cup
        made_up(2, (0,)),  # waves: neither object is its own
        made_up(-1, (0,)),  # demonstrates nothing
    ]
)


def test_bystanders_stand_still_and_are_not_the_skills_own() -> None:
    expected = [[True, False], [False, False], [False, True], [True, True], [False, False]]
    assert bystanders(DATA, FACTORS, SKILLS).tolist() == expected


def test_an_object_that_moves_in_the_last_step_alone_has_moved() -> None:
    late = made_up(2, ())
    late.next_observations[-1, 1] += 1
    assert not bystanders(concatenate([late, DATA]), FACTORS, SKILLS)[0, 1]


def test_what_is_swapped_is_whole_and_from_one_state() -> None:
    rows = np.arange(len(DATA)).repeat(200)
    swapping = Swapping.of(DATA, FACTORS, SKILLS, 1.0)
    swapped, donors, after = swapping.draw(rows, stream("swaps"))
    assert swapped.shape == donors.shape == after.shape == (len(rows), 5)
    assert not swapped[:, [0, 4]].any()  # the robot, and what belongs to nothing
    assert np.array_equal(swapped[:, 1], swapped[:, 3])
    assert np.array_equal(donors[:, 1], donors[:, 3])
    assert np.array_equal(after[:, 1], after[:, 3])
    assert (donors[:, 1] != donors[:, 2]).any()
    may = np.repeat(bystanders(DATA, FACTORS, SKILLS), STEPS, axis=0)[rows]
    assert not swapped[:, [2, 1]][~may].any()
    assert swapped[:, [2, 1]][may].mean() == pytest.approx(0.5, abs=0.03)
    assert set(donors[~after[:, 1], 1]) == set(range(len(DATA)))


def test_half_are_as_a_demonstration_about_them_left_them() -> None:
    failed = made_up(0, (0, 1), seed=2)
    failed.episode_successes[:] = False
    swapping = Swapping.of(concatenate([DATA, failed]), FACTORS, SKILLS, 1.0)
    _, donors, after = swapping.draw(np.zeros(4000, dtype=np.int64), stream("swaps"))
    ends = {1: {STEPS - 1, 2 * STEPS - 1}, 2: {3 * STEPS - 1}}  # of the door's, and the cup's
    for column, last in ends.items():
        assert after[:, column].mean() == pytest.approx(0.5, abs=0.03)
        assert set(donors[after[:, column], column]) == last


def test_an_object_that_nothing_is_about_is_taken_from_any_state() -> None:
    idle = Factors(FACTORS.pose, FACTORS.objects, own={"open": "door"})
    swapping = Swapping.of(DATA, idle, SKILLS, 1.0)
    swapped, donors, after = swapping.draw(np.arange(len(DATA)).repeat(200), stream("swaps"))
    assert swapped[:, 2].any()
    assert not after[:, 2].any()
    assert set(donors[:, 2]) == set(range(len(DATA)))


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_so_many_transitions_have_swapped_objects(share: float) -> None:
    rows = np.arange(3 * STEPS, 4 * STEPS).repeat(500)  # both objects are free
    swapped, *_ = Swapping.of(DATA, FACTORS, SKILLS, share).draw(rows, stream("swaps"))
    assert swapped.any(axis=1).mean() == pytest.approx(0.75 * share, abs=0.02)


def test_what_blurs_stands_still_beside_how_far_it_is_moved() -> None:
    """However small its deviation over the data: most have it shut, but for its own last state."""
    rare = concatenate([DATA, *[made_up(2, (), seed) for seed in range(40)]])
    for states in (rare.observations, rare.next_observations):
        states[:, 1] = stream("blur", len(states)).uniform(-0.001, 0.001, len(rare))
    rare.next_observations[[STEPS - 1, 2 * STEPS - 1], 1] = 0.1
    assert 0.1 * rare.observations[:, 1].std() < 0.001
    free = bystanders(rare, FACTORS, SKILLS)[:, FACTORS.names.index("door")]
    assert free.tolist() == [False, False, True, True, False, *[True] * 40]


def test_an_object_that_nothing_is_about_is_measured_by_the_most_that_it_moves() -> None:
    idle = Factors(FACTORS.pose, FACTORS.objects, own={"open": "door"})
    cup = bystanders(DATA, idle, SKILLS)[:, idle.names.index("cup")]
    assert cup.tolist() == [True, False, False, True, False]


def test_columns_know_their_objects() -> None:
    assert FACTORS.object_of(5).tolist() == [NO_OBJECT, 1, 0, 1, NO_OBJECT]
