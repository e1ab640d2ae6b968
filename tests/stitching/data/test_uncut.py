"""What Single-Policy learns from: whole demonstrations, their own rewards, no skill's vector."""

import numpy as np
import pytest
import torch

from stitching.data.transitions import NO_SKILL, Transitions
from stitching.data.uncut import no_conditions, uncut_experience
from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.iql import IQLConfig, train_iql

ACTIONS = ActionSpace(size=2, discrete=False)


@pytest.fixture
def data() -> Transitions:
    """Two demonstrations of three and two steps; the second misses its end."""
    states = np.random.default_rng(0).random((6, 4), dtype=np.float32)
    return Transitions(
        observations=states[:5],
        actions=np.full((5, 2), 0.5, dtype=np.float32),
        next_observations=states[1:],
        episode_ends=np.array([3, 5]),
        episode_skills=np.array([NO_SKILL, NO_SKILL]),
        episode_successes=np.array([True, False]),
    )


REWARDS = np.array([1, 0, 1, 1, 0], dtype=np.float32)


def test_every_row_once_and_only_a_success_ends_the_task(data: Transitions) -> None:
    experience = uncut_experience(data, REWARDS)
    assert experience.rows.tolist() == [0, 1, 2, 3, 4]
    assert experience.rewards.tolist() == REWARDS.tolist()
    assert experience.terminals.tolist() == [False, False, True, False, False]


def test_its_policy_is_the_same_whatever_is_asked_for(data: Transitions) -> None:
    config = IQLConfig(updates=3, batch_size=4, members=1, width=8)
    trained = train_iql(uncut_experience(data, REWARDS), ACTIONS, config, "test")
    agent = Agent(trained.weights, no_conditions(3), ACTIONS)
    states = torch.from_numpy(np.asarray(data.observations))
    acts = {agent.act(states, skill, noise=None).tobytes() for skill in range(3)}
    values = {agent.values(states, skill).numpy().tobytes() for skill in range(3)}
    assert len(acts) == len(values) == 1
