"""MF-Stitch's "mixed" dataset (paper 4.1.2), in the ways in which its one sentence can be read.

"The second half of the trajectories of the previous skill and the first half of the trajectories
of the next skill are directly mixed together": nothing is said of conditioning and reward. Every
reading takes the demonstrations that succeed, for all ordered pairs of skills at once, and has one
condition a pair, in the order of `skill_pairs`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from typing import Literal

import numpy as np

from stitching.data.experience import Experience, Trajectory, gather
from stitching.data.transitions import Transitions

Mixture = Literal["halves", "joined", "next-reward", "next-skill", "fine-tuned"]


def mixed_experience(
    data: Transitions, conditions: np.ndarray, mixture: Mixture, gamma: float
) -> Experience:
    """The mixed dataset as one of the readings has it, for learning under a discount γ.

    conditions: (skills, condition) float32.
    """
    return READINGS[mixture](data, conditions, gamma)


def halves(data: Transitions, conditions: np.ndarray, gamma: float) -> Experience:
    """Halves apart: reaching the middle of one of the next skill's demonstrations earns 1.

    Where the previous skill's demonstration ends, the data end too: bootstrapping there, from a
    state from which no action was ever seen, makes the values diverge.
    """
    episodes = _episodes(data, len(conditions))
    trajectories = []
    for pair, (previous, following) in enumerate(skill_pairs(len(conditions))):
        trajectories += [
            Trajectory(_second(rows), pair, 0, terminal=True) for rows in episodes[previous]
        ]
        trajectories += [
            Trajectory(_first(rows), pair, 1, terminal=True) for rows in episodes[following]
        ]
    return gather(data, _of_both_skills(conditions), trajectories)


def joined(data: Transitions, conditions: np.ndarray, gamma: float) -> Experience:
    """A half of each skill as one trajectory, along which the value flows; its end earns 1.

    No such transition was ever made: the previous skill's last action is said to lead to where the
    next skill's demonstration begins. Each joint is therefore a row of its own, beside the data's.
    Demonstrations are joined in their order; those of the skill that has fewer serve repeatedly.
    """
    episodes = _episodes(data, len(conditions))
    leaving: list[int] = []  # rows whose observation and action a joint has
    arriving: list[int] = []  # rows whose observation it is said to lead to
    trajectories = []
    for pair, (previous, following) in enumerate(skill_pairs(len(conditions))):
        for before, after in _matched(episodes[previous], episodes[following]):
            joint = len(data) + len(leaving)
            leaving.append(before[-1])
            arriving.append(after[0])
            rows = np.concatenate([_second(before)[:-1], [joint], _first(after)])
            trajectories.append(Trajectory(rows, pair, 1, terminal=True))
    seen = data.observations
    with_joints = replace(
        data,
        observations=np.concatenate([seen, seen[leaving]]),
        actions=np.concatenate([data.actions, data.actions[leaving]]),
        next_observations=np.concatenate([data.next_observations, seen[arriving]]),
    )
    return gather(with_joints, _of_both_skills(conditions), trajectories)


def next_reward(data: Transitions, conditions: np.ndarray, gamma: float) -> Experience:
    """The next skill's own reward, which lies beyond the middle of its demonstrations.

    So a first half ends with that demonstration's own return from there: γ to the number of steps
    that it still took. The previous skill's half earns nothing.
    """
    return _with_next_reward(data, _of_both_skills(conditions), len(conditions), gamma)


def next_skill(data: Transitions, conditions: np.ndarray, gamma: float) -> Experience:
    """The same for a policy that knows of the next skill alone."""
    following = [following for _, following in skill_pairs(len(conditions))]
    return _with_next_reward(data, conditions[following], len(conditions), gamma)


READINGS: dict[Mixture, Callable[[Transitions, np.ndarray, float], Experience]] = {
    "halves": halves,
    "joined": joined,
    "next-reward": next_reward,
    "next-skill": next_skill,
    "fine-tuned": next_skill,  # learned by the next skill's policy
}


def skill_pairs(skills: int) -> list[tuple[int, int]]:
    """All ordered pairs (previous, following).

    Tasks are permutations of skills, save where there is but one, which can only follow itself.
    """
    return list(permutations(range(skills), 2)) or [(0, 0)]


def _of_both_skills(conditions: np.ndarray) -> np.ndarray:
    """Both skills' vectors side by side, a row an ordered pair: (pairs, 2 · condition)."""
    pairs = skill_pairs(len(conditions))
    return np.array([np.concatenate([conditions[i], conditions[j]]) for i, j in pairs])


def _with_next_reward(
    data: Transitions, conditions: np.ndarray, skills: int, gamma: float
) -> Experience:
    episodes = _episodes(data, skills)
    trajectories = []
    for pair, (previous, following) in enumerate(skill_pairs(skills)):
        trajectories += [
            Trajectory(_second(rows), pair, 0, terminal=True) for rows in episodes[previous]
        ]
        for rows in episodes[following]:
            to_come = gamma ** len(_second(rows))
            trajectories.append(Trajectory(_first(rows), pair, to_come, terminal=True))
    return gather(data, conditions, trajectories)


def _episodes(data: Transitions, skills: int) -> list[list[np.ndarray]]:
    """Rows of each demonstration that succeeds and has two halves, by skill."""
    return [
        [
            rows
            for rows, success in zip(
                data.episode_rows(skill),
                data.episode_successes[data.episode_skills == skill],
                strict=True,
            )
            if success and len(rows) > 1
        ]
        for skill in range(skills)
    ]


def _first(rows: np.ndarray) -> np.ndarray:
    return rows[: len(rows) // 2]


def _second(rows: np.ndarray) -> np.ndarray:
    """The longer half of an odd demonstration."""
    return rows[len(rows) // 2 :]


def _matched(
    previous: list[np.ndarray], following: list[np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Each demonstration of both with one of the other; none where one has none."""
    if not previous or not following:
        return []
    count = max(len(previous), len(following))
    return [(previous[n % len(previous)], following[n % len(following)]) for n in range(count)]
