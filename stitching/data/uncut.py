"""What one policy learns a long task from: whole demonstrations, under no condition."""

from __future__ import annotations

import numpy as np

from stitching.data.experience import Experience
from stitching.data.transitions import Transitions


def no_conditions(skills: int) -> np.ndarray:
    """(skills, 0) float32: an agent that hears nothing of which skill is asked for."""
    return np.zeros((skills, 0), dtype=np.float32)


def uncut_experience(data: Transitions, rewards: np.ndarray) -> Experience:
    """Demonstrations as they are, with rewards (N,) float32 of their own.

    A success ends the task, so nothing is bootstrapped beyond it.
    """
    terminals = np.zeros(len(data), dtype=bool)
    terminals[data.episode_ends - 1] = data.episode_successes
    return Experience(
        data,
        rows=np.arange(len(data)),
        condition_ids=np.zeros(len(data), dtype=np.int64),
        conditions=no_conditions(1),
        rewards=rewards,
        terminals=terminals,
    )
