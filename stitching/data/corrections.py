"""Corrective labels: the robot is displaced, and its action brings it back to the demonstration.

A policy that imitates steady demonstrators knows nothing of the states beside theirs: on
Kitchen's expert data it fails most of the time where the arm's joints are off by 0.06 rad. How the
robot moves can be learned from the same data, and so can the action that would have
brought it back. After Ke et al. (2024), CCIL: Continuity-based Data Augmentation for Corrective
Imitation Learning, which finds such labels with learned dynamics. Here a linear model of the robot
alone serves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stitching.data.robot import RobotModel, before_contact
from stitching.data.transitions import DataError, Transitions
from stitching.envs.factors import Factors

SHARE = 0.5  # of the transitions in which the robot may be displaced
STEPS_BACK = 3  # a corrected action brings the robot back by one of so many equal parts
FARTHEST = 3  # deviations by which a number is displaced at most


@dataclass(frozen=True)
class Displaced:
    """What to add to transitions (B,) of the data."""

    now: np.ndarray  # (B, observation) float32
    actions: np.ndarray  # (B, action) float32; with it an action still lies within [−1, 1]
    following: np.ndarray  # (B, observation) float32


@dataclass(frozen=True)
class Corrections:
    """Draws, for a minibatch of transitions, how far the robot is displaced and what it does then.

    The data say how the robot moves: x' − x = A x + B a + c, x being its numbers and velocities,
    by least squares. In half of the transitions before a demonstration moves the object that it
    is about, the pose is displaced by δ ~ N(0, σ²), and

        ã  = clip(a − B⁺ δ / 3, −1, 1)
        x̃' = x' + δ + A δ + B (ã − a)

    so that it makes a transition as the linear model has it, about a third of the way back. δ is
    cut off at three deviations.
    """

    deviations: np.ndarray  # (displaced,) σ of each number of the pose that is displaced
    pose: np.ndarray  # (displaced,) their columns
    robot: np.ndarray  # (known,) all columns whose changes the model explains, these among them
    drift: np.ndarray  # (known, displaced) A
    effect: np.ndarray  # (known, action) B
    back: np.ndarray  # (action, displaced) B⁺ of the pose
    free: np.ndarray  # (N,) bool, transitions in which the robot may be displaced
    size: int  # numbers of an observation

    @classmethod
    def of(
        cls, data: Transitions, factors: Factors, skills: Sequence[str], steps: float
    ) -> Corrections:
        """σ is so many steps: the root mean square of what each number changes by in one.

        A number of the pose is displaced if the model explains nine tenths of the variance of its
        changes. Raises DataError where that holds for none.
        """
        free = before_contact(data, factors, skills)
        model = RobotModel.of(data, free, factors)
        robot, known = model.columns, model.explained
        displaced = known & np.isin(robot, factors.pose)
        if not displaced.any():
            raise DataError("corrections: the data do not tell how actions move the robot")
        pose = robot[displaced]
        before = data.observations[free][:, pose].astype(np.float64)
        changes = data.next_observations[free][:, pose] - before
        return cls(
            steps * np.sqrt(np.square(changes).mean(axis=0)),
            pose,
            robot[known],
            model.drift[np.ix_(known, displaced)],
            model.effect[known],
            np.linalg.pinv(model.effect[displaced]),
            free,
            data.observations.shape[1],
        )

    def draw(self, rows: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> Displaced:
        """For transitions (B,) int64 and their actions (B, action)."""
        chosen = (rng.random(len(rows)) < SHARE) & self.free[rows]
        noise = rng.normal(size=(len(rows), len(self.pose))).clip(-FARTHEST, FARTHEST)
        away = noise * self.deviations * chosen[:, None]
        corrected = np.clip(actions - away @ self.back.T / STEPS_BACK, -1, 1)
        change = np.where(chosen[:, None], corrected - actions, 0)
        now = np.zeros((len(rows), self.size), dtype=np.float32)
        now[:, self.pose] = away
        following = now.copy()
        following[:, self.robot] += away @ self.drift.T + change @ self.effect.T
        return Displaced(now, change.astype(np.float32), following)

    def widened(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The range of all that is drawn, given that of the data: (observation,) each."""
        reach = np.zeros(self.size)
        reach[self.robot] = 2 * np.abs(self.effect).sum(axis=1)  # an action changes by 2 at most
        reach[self.robot] += FARTHEST * np.abs(self.drift) @ self.deviations
        reach[self.pose] += FARTHEST * self.deviations
        return (low - reach).astype(np.float32), (high + reach).astype(np.float32)
