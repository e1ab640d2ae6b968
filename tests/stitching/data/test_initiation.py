"""Initiation sets: where demonstrations that succeed begin, and how near is near enough."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from stitching.data.initiation import FINENESS, START, InitiationSet, initiation_set, pose_scale
from stitching.data.transitions import Transitions
from stitching.envs.factors import Factors
from stitching.streams import stream

FACTORS = Factors(pose=(0, 2))
STEPS, EPISODES = 10, 30


def walks(spread: float, pace: float, successes: int = EPISODES) -> Transitions:
    """Skill 0 from starts so far apart, moving so much a step; skill 1 fails throughout."""
    rng = stream("walks")
    starts = rng.normal(0, spread, (2 * EPISODES, 1, 3))
    steps = rng.normal(0, pace, (2 * EPISODES, STEPS, 3)).cumsum(axis=1)
    paths = np.concatenate([starts, starts + steps], axis=1).astype(np.float32)
    done = np.arange(2 * EPISODES) < successes
    return Transitions(
        paths[:, :-1].reshape(-1, 3),
        np.zeros((2 * EPISODES * STEPS, 1), dtype=np.float32),
        paths[:, 1:].reshape(-1, 3),
        STEPS * np.arange(1, 2 * EPISODES + 1),
        np.repeat([0, 1], EPISODES),
        done,
    )


def poses(found: InitiationSet, data: Transitions) -> np.ndarray:
    """In units of the scale."""
    seen: np.ndarray = found.states[:, [0, 2]] / pose_scale(data, FACTORS)
    return seen


def paths(data: Transitions) -> np.ndarray:
    """The poses of skill 0's demonstrations, in units of the scale: (EPISODES, STEPS + 1, 2)."""
    shape = (2 * EPISODES, STEPS, 3)
    seen, then = data.observations.reshape(shape), data.next_observations.reshape(shape)
    whole = np.concatenate([seen, then[:, -1:]], axis=1)
    return whole[:EPISODES, :, [0, 2]] / pose_scale(data, FACTORS)


def starts(data: Transitions) -> np.ndarray:
    """The poses of each demonstration before the robot has got START of its way: (n, 2)."""
    begun = []
    for path in paths(data):
        gets = max(np.linalg.norm(pose - path[0]) for pose in path)
        for pose in path:
            if np.linalg.norm(pose - path[0]) > START * gets:
                break
            begun.append(pose)
    return np.array(begun)


def test_a_deviation_in_every_number_is_a_distance_of_one() -> None:
    data = walks(1.0, 0.1)
    deviation = data.observations.std(axis=0)[[0, 2]]
    assert np.linalg.norm(deviation / pose_scale(data, FACTORS)) == pytest.approx(1.0, rel=1e-5)


def test_the_set_covers_every_start_and_holds_nothing_else() -> None:
    data = walks(0.1, 0.1)
    found = initiation_set(data, FACTORS, 0)
    begun = starts(data)
    assert EPISODES < len(begun) < EPISODES * STEPS
    kept = poses(found, data)
    gaps = cdist(begun, kept)
    assert gaps.min(axis=1).max() <= FINENESS * found.radius + 1e-6
    assert gaps.min(axis=0).max() < 1e-6
    between = cdist(kept, kept)
    np.fill_diagonal(between, np.inf)
    assert between.min() > FINENESS * found.radius
    assert len(kept) < len(begun)
    assert set(map(tuple, found.states)) <= set(map(tuple, data.observations))


def test_epsilon_is_two_steps_of_the_skills_demonstrations() -> None:
    data = walks(1.0, 0.1)
    moved = (data.next_observations - data.observations)[: EPISODES * STEPS, [0, 2]]
    step = np.median(np.linalg.norm(moved / pose_scale(data, FACTORS), axis=1))
    assert initiation_set(data, FACTORS, 0).radius == pytest.approx(2 * step)


def test_a_start_is_a_share_of_the_way_however_many_steps_it_has() -> None:
    """A robot that is told where to go twice as often begins and moves as before."""
    data = walks(1.0, 0.01)
    halfway = (data.observations + data.next_observations) / 2
    often = Transitions(
        np.stack([data.observations, halfway], axis=1).reshape(-1, 3),
        np.repeat(data.actions, 2, axis=0),
        np.stack([halfway, data.next_observations], axis=1).reshape(-1, 3),
        2 * data.episode_ends,
        data.episode_skills,
        data.episode_successes,
    )
    once, twice = (initiation_set(one, FACTORS, 0) for one in (data, often))
    rarely, closely = poses(once, data), poses(twice, often)
    assert cdist(rarely, closely).min(axis=1).max() <= once.radius / 2
    assert cdist(closely, rarely).min(axis=1).max() <= once.radius


@pytest.mark.parametrize(("skill", "successes"), [(1, EPISODES), (0, 0), (2, EPISODES)])
def test_nothing_is_known_of_skills_that_never_succeed(skill: int, successes: int) -> None:
    found = initiation_set(walks(1.0, 0.1, successes), FACTORS, skill)
    assert found.states.shape == (0, 3)
    assert found.radius == np.inf
