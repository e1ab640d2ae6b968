"""How actions move the robot, from demonstrations: a linear model of all that is no object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stitching.data.swapping import STILL, usual_moves
from stitching.data.transitions import Transitions
from stitching.envs.factors import NO_OBJECT, Factors

KNOWN = 0.9  # of a number's variance: the model is said to explain what it explains so much of


@dataclass(frozen=True)
class RobotModel:
    """x' − x = A x + B a + c, by least squares; x: the robot's numbers, velocities included."""

    columns: np.ndarray  # (robot,) of an observation
    drift: np.ndarray  # (robot, robot) A
    effect: np.ndarray  # (robot, action) B
    offset: np.ndarray  # (robot,) c
    explained: np.ndarray  # (robot,) bool: nine tenths of the variance of its changes

    @classmethod
    def of(cls, data: Transitions, rows: np.ndarray, factors: Factors) -> RobotModel:
        """From these transitions: rows (N,) bool."""
        columns = np.flatnonzero(factors.object_of(data.observations.shape[1]) == NO_OBJECT)
        states = data.observations[rows][:, columns].astype(np.float64)
        changes = data.next_observations[rows][:, columns] - states
        causes = np.concatenate([states, data.actions[rows], np.ones((len(states), 1))], axis=1)
        solution, *_ = np.linalg.lstsq(causes, changes, rcond=None)
        errors = changes - causes @ solution
        return cls(
            columns,
            solution[: len(columns)].T,
            solution[len(columns) : -1].T,
            solution[-1],
            errors.var(axis=0) < (1 - KNOWN) * changes.var(axis=0),
        )


def before_contact(data: Transitions, factors: Factors, skills: Sequence[str]) -> np.ndarray:
    """Transitions until a demonstration moves the object that its skill is about, (N,) bool.

    That is, by more than a tenth of what it usually moves, from where it stood at first. A hand
    that holds an object does not move as it does alone. All transitions where a skill is about
    nothing, as where there is no object.
    """
    if not factors.own:
        return np.ones(len(data), dtype=bool)
    usual = usual_moves(data, factors, skills)
    free = np.ones(len(data), dtype=bool)
    starts = data.episode_starts
    for start, end, skill in zip(starts, data.episode_ends, data.episode_skills, strict=True):
        own = factors.own.get(skills[skill]) if skill >= 0 else None
        if own is not None:
            where = data.next_observations[start:end, list(factors.objects[own].positions)]
            first = data.observations[start, list(factors.objects[own].positions)]
            moved = np.abs(where - first).max(axis=1) > STILL * usual[factors.names.index(own)]
            free[start:end] = ~np.logical_or.accumulate(moved)
    return free
