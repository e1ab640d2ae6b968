"""What an offline RL learner samples from: rows of a dataset, each with condition and reward."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
    pieces = []
    starts = data.episode_starts
    for episode in np.flatnonzero(data.episode_skills >= 0):
        rows = np.arange(starts[episode], data.episode_ends[episode])
        succeeds = data.episode_successes[episode]
        pieces.append(Piece(rows, data.episode_skills[episode], succeeds, ends=succeeds))
    return _gather(data, conditions, pieces)


def mixed_experience(data: Transitions, conditions: np.ndarray) -> Experience:
    """MF-Stitch's "mixed" dataset (4.1.2), for every ordered pair of skills at once.

    For the pair (i, j): second halves of i's episodes, then first halves of j's, of those that
    succeed. The paper leaves conditioning and reward open; ours: the policy is conditioned on both
    skills' vectors, and reaching the middle of one of j's demonstrations earns 1 and ends the
    stitch. Where one of i's demonstrations ends, the data end too: bootstrapping there, from a
    state from which no action was ever seen, makes the values diverge.
    """
    episodes = [
        [
            rows
            for rows, success in zip(
                data.episode_rows(skill),
                data.episode_successes[data.episode_skills == skill],
                strict=True,
            )
            if success and len(rows) > 1
        ]
        for skill in range(len(conditions))
    ]
    pieces = []
    for pair, (previous, following) in enumerate(skill_pairs(len(conditions))):
        pieces += [
            Piece(rows[len(rows) // 2 :], pair, earns=False, ends=True)
            for rows in episodes[previous]
        ]
        pieces += [
            Piece(rows[: len(rows) // 2], pair, earns=True, ends=True)
            for rows in episodes[following]
        ]
    return _gather(data, mixed_conditions(conditions), pieces)


def skill_pairs(skills: int) -> list[tuple[int, int]]:
    """All ordered pairs (previous, following), in the order of `mixed_conditions`.

    Tasks are permutations of skills, save where there is but one, which can only follow itself.
    """
    return list(permutations(range(skills), 2)) or [(0, 0)]


def mixed_conditions(conditions: np.ndarray) -> np.ndarray:
    """Both skills' vectors side by side, a row an ordered pair: (pairs, 2 · condition)."""
    pairs = skill_pairs(len(conditions))
    return np.array([np.concatenate([conditions[i], conditions[j]]) for i, j in pairs])


@dataclass(frozen=True)
class Piece:
    """Consecutive rows under one condition, and what their last transition means."""

    rows: np.ndarray
    condition_id: int
    earns: bool  # reward 1 for the last transition
    ends: bool  # nothing is bootstrapped beyond it


def _gather(data: Transitions, conditions: np.ndarray, pieces: list[Piece]) -> Experience:
    if not pieces:
        raise DataError("the dataset demonstrates no skill: nothing to learn from")
    lengths = [len(piece.rows) for piece in pieces]
    last = np.cumsum(lengths) - 1
    rewards = np.zeros(sum(lengths), dtype=np.float32)
    rewards[last] = [piece.earns for piece in pieces]
    terminals = np.zeros(sum(lengths), dtype=bool)
    terminals[last] = [piece.ends for piece in pieces]
    return Experience(
        data,
        np.concatenate([piece.rows for piece in pieces]),
        np.repeat([piece.condition_id for piece in pieces], lengths),
        conditions,
        rewards,
        terminals,
    )
