"""Uncut demonstrations of one long task: whole, rewarded at each accomplishment."""

from dataclasses import replace

import numpy as np
import pytest

from stitching.data.kitchen import long_horizon
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from stitching.data.kitchen.long_horizon import long_horizon_data
from stitching.data.transitions import NO_SKILL, DataError, Transitions, check
from stitching.envs.kitchen import GOAL_RADIUS, KITCHEN, SKILLS, goal_distances

ORDER = ("microwave", "kettle", "light switch")
CONFIG = KitchenDataConfig(episodes=3)
BLUR = 0.005  # more than the observation's noise moves a distance


@pytest.fixture(scope="module")
def made() -> tuple[Transitions, np.ndarray]:
    return long_horizon_data(CONFIG, ORDER, seed=0)


def test_every_demonstration_is_the_whole_task(made: tuple[Transitions, np.ndarray]) -> None:
    data, rewards = made
    check(data, KITCHEN, "data")
    assert set(data.episode_skills) == {NO_SKILL}
    assert data.episode_successes.all()
    assert len(data.episode_ends) >= 2
    for start, end in zip(data.episode_starts, data.episode_ends, strict=True):
        np.testing.assert_array_equal(data.next_observations[start : end - 1],
                                      data.observations[start + 1 : end])  # fmt: skip
        assert rewards[start:end].sum() == len(ORDER)


def test_rewards_are_at_first_achievements_in_order(made: tuple[Transitions, np.ndarray]) -> None:
    data, rewards = made
    seen = data.next_observations
    positions = np.hstack([seen[:, :9], seen[:, 18:39]])
    for start, end in zip(data.episode_starts, data.episode_ends, strict=True):
        paid = start + np.flatnonzero(rewards[start:end])
        assert paid[-1] == end - 1
        for row, name in zip(paid, ORDER, strict=True):
            distances = goal_distances(positions[start : row + 1], SKILLS.index(name))
            assert distances[-1] < GOAL_RADIUS + BLUR
            assert (distances[:-1] > GOAL_RADIUS - BLUR).all()


def test_a_demonstration_hangs_on_its_number_alone(
    made: tuple[Transitions, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(long_horizon, "TOGETHER", 2)
    again, rewards = long_horizon_data(CONFIG, ORDER, seed=0)
    assert again.observations.tobytes() == made[0].observations.tobytes()
    assert rewards.tobytes() == made[1].tobytes()


def test_what_misses_a_skill_is_left_out() -> None:
    hasty = replace(CONFIG, episodes=1, skill_steps=5)
    with pytest.raises(DataError, match="no demonstration of microwave>kettle>light switch"):
        long_horizon_data(hasty, ORDER, seed=0)
