"""Episodes in which a skill is accomplished once: when its goal holds for the first time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stitching.envs.protocol import VectorEnv


class FirstTimes:
    """For policies that are not told which skill is asked for, and may be ahead of it.

    A goal that has held before the skill was asked for counts as not achieved, also where it holds
    again: some come undone, as the kettle's when the hand leaves it. Snapshots say what has held,
    so a task is accomplished in order where its skills' first achievements come in that order,
    whatever else comes in between.
    """

    def __init__(self, env: VectorEnv, skills: int) -> None:
        self.inner, self._skills = env, skills
        self._before = np.zeros((0, skills), dtype=bool)  # (N, skills) what held until this segment
        self._held = self._before  # (N, skills) and until now

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        self.inner.reset(streams)
        self._before = self._holding(np.arange(len(streams)))
        self._held = self._before.copy()

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        inner, held = np.split(snapshots, [-self._skills], axis=1)
        self.inner.restore(inner, streams)
        self._before = held.astype(bool)
        self._held = self._before.copy()

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        return np.hstack([self.inner.snapshot(rows), self._held[rows]])

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self.inner.observe(rows)

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        self.inner.step(rows, actions)
        self._held[rows] |= self._holding(rows)

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        return self._held[rows, skill] & ~self._before[rows, skill]

    def _holding(self, rows: np.ndarray) -> np.ndarray:
        """Which goals hold now: (n, skills) bool."""
        return np.stack([self.inner.achieved(rows, skill) for skill in range(self._skills)], axis=1)
