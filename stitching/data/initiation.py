"""Initiation sets: the poses of the robot from which a skill was demonstrated.

The word is that of options (Sutton, Precup and Singh 1999): the states in which one may begin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stitching.data.transitions import Transitions
from stitching.envs.factors import Factors
from stitching.models.scale import observation_scale

START = 1 / 3  # of the way, as far as the robot gets from where a demonstration begins
STEPS_NEAR = 2  # ε, in steps of the demonstrations: their median
FINENESS = 0.25  # of ε: poses nearer than this to one that is kept are left out


@dataclass(frozen=True)
class InitiationSet:
    """Where one skill begins, as states of its demonstrations, and how near is near enough.

    A skill without a demonstration that succeeds has an empty set, and ε is infinite: nothing is
    known of where it begins.
    """

    states: np.ndarray  # (P, observation) float32
    radius: float  # ε: a state whose pose is this near to that of one of the set is in it


def distance_scale(data: Transitions, columns: list[int]) -> np.ndarray:
    """What these columns of an observation are divided by before distances, (columns,) float32.

    Their standard deviation over the dataset, times the square root of how many there are: two
    states that differ by one standard deviation in every number are at a Euclidean distance of 1.
    """
    _, deviation = observation_scale(data.observations)
    scale: np.ndarray = deviation[columns] * np.float32(len(columns) ** 0.5)
    return scale


def pose_scale(data: Transitions, factors: Factors) -> np.ndarray:
    """`distance_scale` of the numbers of a pose, (pose,) float32."""
    return distance_scale(data, list(factors.pose))


def initiation_set(data: Transitions, factors: Factors, skill: int) -> InitiationSet:
    """The starts of a skill's demonstrations that succeeded, thinned.

    A demonstration's start is its states until its pose is farther from the first than START times
    the farthest that it gets. ε is twice the median distance that the robot moves in one step of
    these demonstrations: it is not sent nearer than it moves. (How far their first poses lie from
    one another, the other measure at hand, says how sparse they are, not where the skill works.) A
    pose is kept if it is farther than ε/4 from all that were kept before it, in the dataset's
    order, so the set covers every start to ε/4.
    """
    scale, columns = pose_scale(data, factors), list(factors.pose)
    shown = [
        rows
        for rows, success in zip(
            data.episode_rows(skill),
            data.episode_successes[data.episode_skills == skill],
            strict=True,
        )
        if success
    ]
    if not shown:
        return InitiationSet(data.observations[:0], np.inf)
    every = np.concatenate(shown)
    moves = (data.next_observations[every] - data.observations[every])[:, columns] / scale
    radius = STEPS_NEAR * float(np.median(np.linalg.norm(moves, axis=1)))
    paths = [_path(data, rows) for rows in shown]
    starts = [path[: _begun(path[:, columns] / scale)] for path in paths]
    states = np.concatenate(starts)
    return InitiationSet(states[_thinned(states[:, columns] / scale, FINENESS * radius)], radius)


def _path(data: Transitions, rows: np.ndarray) -> np.ndarray:
    """All states of the demonstration in these rows, the last included: (T + 1, observation)."""
    return np.concatenate([data.observations[rows], data.next_observations[rows[-1:]]])


def _begun(path: np.ndarray) -> int:
    """How many poses a demonstration has until START of its way: of (T + 1, pose)."""
    away = np.linalg.norm(path - path[0], axis=1)
    return int(np.logical_and.accumulate(away <= START * away.max()).sum())


def _thinned(poses: np.ndarray, gap: float) -> list[int]:
    """Which of (n, pose) are farther than `gap` from all kept before them."""
    kept: list[int] = []
    for number, pose in enumerate(poses):
        if not kept or np.linalg.norm(poses[kept] - pose, axis=1).min() > gap:
            kept.append(number)
    return kept
