"""What an offline RL learner samples from: rows of a dataset, each with condition and reward."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stitching.data.transitions import DataError, Transitions


@dataclass(frozen=True)
class Experience:
    """K labelled references into a dataset; a row may occur under several conditions."""

    data: Transitions
    rows: np.ndarray  # (K,) int64 into data
    condition_ids: np.ndarray  # (K,) int64 into conditions
    conditions: np.ndarray  # (C, condition) float32
    rewards: np.ndarray  # (K,) float32
    terminals: np.ndarray  # (K,) bool; nothing is bootstrapped beyond them

    def of(self, condition: int) -> Experience:
        """What is labelled with one of the conditions; DataError if nothing is."""
        own = self.condition_ids == condition
        if not own.any():
            raise DataError(f"the dataset demonstrates nothing of skill {condition}")
        return replace(
            self,
            rows=self.rows[own],
            condition_ids=self.condition_ids[own],
            rewards=self.rewards[own],
            terminals=self.terminals[own],
        )


def skill_experience(data: Transitions, conditions: np.ndarray) -> Experience:
    """Multi-task skill learning: reward 1 where a demonstration achieves its skill, which ends it.

    The paper gives no rewards; with this one V(s) is γ to the number of steps still needed, so
    the skills' values share one scale. conditions: (skills, condition) float32.
    """
    trajectories = []
    starts = data.episode_starts
    for episode in np.flatnonzero(data.episode_skills >= 0):
        rows = np.arange(starts[episode], data.episode_ends[episode])
        succeeds = data.episode_successes[episode]
        trajectories.append(
            Trajectory(rows, data.episode_skills[episode], float(succeeds), terminal=succeeds)
        )
    return gather(data, conditions, trajectories)


@dataclass(frozen=True)
class Trajectory:
    """Consecutive rows learned from under one condition, and what their last transition means."""

    rows: np.ndarray
    condition_id: int
    reward: float  # for the last transition; the others have none
    terminal: bool  # nothing is bootstrapped beyond it


def gather(data: Transitions, conditions: np.ndarray, trajectories: list[Trajectory]) -> Experience:
    """The trajectories one after the other; DataError if there are none."""
    if not trajectories:
        raise DataError("the dataset demonstrates no skill: nothing to learn from")
    lengths = [len(trajectory.rows) for trajectory in trajectories]
    last = np.cumsum(lengths) - 1
    rewards = np.zeros(sum(lengths), dtype=np.float32)
    rewards[last] = [trajectory.reward for trajectory in trajectories]
    terminals = np.zeros(sum(lengths), dtype=bool)
    terminals[last] = [trajectory.terminal for trajectory in trajectories]
    return Experience(
        data,
        np.concatenate([trajectory.rows for trajectory in trajectories]),
        np.repeat([trajectory.condition_id for trajectory in trajectories], lengths),
        conditions,
        rewards,
        terminals,
    )
