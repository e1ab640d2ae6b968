"""Distances to a skill's own demonstrations."""

import numpy as np
import pytest
import torch

from stitching.data.transitions import Transitions
from stitching.models.dynamics import Dynamics
from stitching.studies.demonstrated_states import DemonstratedStates


def test_demonstrated_states_are_at_no_distance(
    demonstrations: Transitions, dynamics: Dynamics
) -> None:
    near = DemonstratedStates.of(demonstrations, 2, dynamics)
    rows = np.concatenate(demonstrations.episode_rows(2))
    own = dynamics.scaled(torch.from_numpy(demonstrations.observations[rows]))
    assert near.distances(own).max() == 0
    away = own[:1] + 100.0
    assert float(near.distances(away)) == pytest.approx(100.0, rel=0.1)


class Unscaled(Dynamics):
    def __init__(self) -> None:
        """Has learned nothing."""

    def scaled(self, states: torch.Tensor) -> torch.Tensor:
        return states


def test_demonstrations_are_typically_as_far_apart_as_they_are() -> None:
    observations = np.repeat(np.array([[0.0], [0.5], [9.0]], dtype=np.float32), [3, 3, 1], axis=0)
    data = Transitions(
        observations=np.tile(observations, (1, 4)),
        actions=np.zeros((7, 2), dtype=np.float32),
        next_observations=np.zeros((7, 4), dtype=np.float32),
        episode_ends=np.array([3, 6, 7]),
        episode_skills=np.array([0, 0, 1]),
        episode_successes=np.ones(3, dtype=bool),
    )
    assert DemonstratedStates.of(data, 0, Unscaled()).typical() == pytest.approx(0.5)
    assert DemonstratedStates.of(data, 1, Unscaled()).typical() is None
