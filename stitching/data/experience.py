"""What an offline RL learner samples from: rows of a dataset, each with condition and reward."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

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


def skill_experience(data: Transitions, conditions: np.ndarray) -> Experience:
    """Multi-task skill learning: reward 1 where a demonstration achieves its skill, which ends it.

    The paper gives no rewards; with this one V(s) is γ to the number of steps still needed, so
    the skills' values share one scale. conditions: (skills, condition) float32.
    """
    pieces = []
    starts = data.episode_starts
    for episode in np.flatnonzero(data.episode_skills >= 0):
        rows = np.arange(starts[episode], data.episode_ends[episode])
        achieved = np.zeros(len(rows), dtype=bool)
        achieved[-1] = data.episode_successes[episode]
        pieces.append((rows, np.full(len(rows), data.episode_skills[episode]), achieved))
    return _gather(data, conditions, pieces)


def mixed_experience(data: Transitions, conditions: np.ndarray) -> Experience:
    """MF-Stitch's "mixed" dataset (4.1.2), for every ordered pair of skills at once.

    For the pair (i, j): second halves of i's episodes, then first halves of j's. The paper leaves
    conditioning and reward open; ours: the policy is conditioned on both skills' vectors, and
    reaching the middle of one of j's demonstrations earns 1 and ends the stitch.
    """
    episodes = [
        [rows for rows in data.episode_rows(skill) if len(rows) > 1]
        for skill in range(len(conditions))
    ]
    pieces = []
    for pair, (previous, following) in enumerate(skill_pairs(len(conditions))):
        halves = [(rows[len(rows) // 2 :], False) for rows in episodes[previous]]
        halves += [(rows[: len(rows) // 2], True) for rows in episodes[following]]
        for rows, reaches_middle in halves:
            achieved = np.zeros(len(rows), dtype=bool)
            achieved[-1] = reaches_middle
            pieces.append((rows, np.full(len(rows), pair), achieved))
    return _gather(data, mixed_conditions(conditions), pieces)


def skill_pairs(skills: int) -> list[tuple[int, int]]:
    """All ordered pairs (previous, following), in the order of `mixed_conditions`."""
    return list(permutations(range(skills), 2))


def mixed_conditions(conditions: np.ndarray) -> np.ndarray:
    """Both skills' vectors side by side, a row an ordered pair: (pairs, 2 · condition)."""
    pairs = skill_pairs(len(conditions))
    return np.array([np.concatenate([conditions[i], conditions[j]]) for i, j in pairs])


def _gather(
    data: Transitions,
    conditions: np.ndarray,
    pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> Experience:
    if not pieces:
        raise DataError("the dataset demonstrates no skill: nothing to learn from")
    rows, condition_ids, achieved = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return Experience(
        data, rows, condition_ids, conditions, achieved.astype(np.float32), terminals=achieved
    )
