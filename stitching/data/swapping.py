"""Counterfactual data augmentation: objects that play no part are as they are in other states.

After Pitis et al. (2020), Counterfactual Data Augmentation using Locally Factored Dynamics: what an
object that stands still does not touch would have gone the same way had it stood elsewhere. A skill
learned so does not fail because a cabinet is open that it has only seen shut.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stitching.data.transitions import Transitions
from stitching.envs.factors import NO_OBJECT, Factors

STILL = 0.1  # of how far an object usually moves: one that moves by less stands still
EACH = 0.5  # share of the objects that may be swapped which are
LEFT = 0.5  # share of those that are as a demonstration about them left them


def bystanders(data: Transitions, factors: Factors, skills: Sequence[str]) -> np.ndarray:
    """Which objects play no part in each episode, (E, objects) bool.

    Those that stand still throughout and are not what the demonstrated skill is about. None in an
    episode that demonstrates no skill. skills: their names, as `episode_skills` numbers them.

    An object stands still where its move is less than a tenth of the usual one.
    """
    moves = _moves(data, factors)
    still: np.ndarray = moves < STILL * _usual(moves, demonstrations_about(data, factors, skills))
    for episode, skill in enumerate(data.episode_skills.tolist()):
        if skill < 0:
            still[episode] = False
        elif (own := factors.own.get(skills[skill])) is not None:
            still[episode, factors.names.index(own)] = False
    return still


def usual_moves(data: Transitions, factors: Factors, skills: Sequence[str]) -> np.ndarray:
    """How far each object is moved by those who mean to, (objects,).

    A move is the largest range of any of an object's positions in an episode. The usual one is the
    median over the demonstrations about the object that succeed, or, where nothing is about it, its
    largest move in any episode. So an object of which only noise is seen never stands still. (A
    tenth of its deviation over the data would be less than the noise for an object that is moved
    in few states.)
    """
    return _usual(_moves(data, factors), demonstrations_about(data, factors, skills))


def _usual(moves: np.ndarray, about: np.ndarray) -> np.ndarray:
    """From moves and whether they are meant, both (E, objects): (objects,)."""
    usual = [
        np.median(own[shown]) if shown.any() else own.max()
        for own, shown in zip(moves.T, about.T, strict=True)
    ]
    return np.array(usual)


def _moves(data: Transitions, factors: Factors) -> np.ndarray:
    """How far each object is moved in each episode, (E, objects)."""
    ranges = _range(data)
    positions = [list(factors.objects[name].positions) for name in factors.names]
    return np.stack([ranges[:, own].max(axis=1) for own in positions], axis=1)


def demonstrations_about(data: Transitions, factors: Factors, skills: Sequence[str]) -> np.ndarray:
    """Which episodes show, with success, a skill that is about each object, (E, objects) bool."""
    about = np.zeros((len(data.episode_skills), len(factors.names)), dtype=bool)
    for skill, name in factors.own.items():
        if skill in skills:
            shown = (data.episode_skills == skills.index(skill)) & data.episode_successes
            about[:, factors.names.index(name)] |= shown
    return about


def _range(data: Transitions) -> np.ndarray:
    """How far each number moves within each episode, (E, observation)."""
    starts, last = data.episode_starts, data.next_observations[data.episode_ends - 1]
    low = np.minimum(np.minimum.reduceat(data.observations, starts), last)
    high = np.maximum(np.maximum.reduceat(data.observations, starts), last)
    return high - low


@dataclass(frozen=True)
class Swapping:
    """Draws, for a minibatch of transitions, the objects to swap and the states to take them from.

    In a share of the transitions each bystander takes, with probability 0.5, the positions and
    velocities that it has in another state, the same in s and s'. In half of the cases that is the
    one in which a demonstration about it that succeeded has left it, else any state of the dataset,
    in hardly any of which an object has been moved that is always moved last. An object that no
    demonstration is about is always taken from any state.
    """

    share: float  # of the transitions, in [0, 1]
    object_of: np.ndarray  # (observation,) int64, the object of each column, NO_OBJECT for none
    bystanders: np.ndarray  # (N, objects) bool, by transition
    left: tuple[np.ndarray, ...]  # by object: transitions (n,) int64 that end demonstrations of it

    @classmethod
    def of(
        cls, data: Transitions, factors: Factors, skills: Sequence[str], share: float
    ) -> Swapping:
        lengths = np.diff(data.episode_ends, prepend=0)
        free = np.repeat(bystanders(data, factors, skills), lengths, axis=0)
        about = demonstrations_about(data, factors, skills)
        left = tuple(data.episode_ends[own] - 1 for own in about.T)
        return cls(share, factors.object_of(data.observations.shape[1]), free, left)

    def draw(
        self, rows: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For transitions (B,) int64: which numbers to swap, and where to take them from.

        Returns (B, observation) each: bool, to be swapped; int64, transitions to take them from;
        bool, whether from the state after that transition and not before. Numbers of one object
        come from one state.
        """
        total, objects = self.bystanders.shape
        swapped = rng.random((len(rows), 1)) < self.share
        swapped = swapped & (rng.random((len(rows), objects)) < EACH) & self.bystanders[rows]
        donors = rng.integers(total, size=(len(rows), objects))
        after = rng.random((len(rows), objects)) < LEFT
        for number, last in enumerate(self.left):
            if len(last):
                done = last[rng.integers(len(last), size=len(rows))]
                donors[:, number] = np.where(after[:, number], done, donors[:, number])
            else:
                after[:, number] = False
        belongs = self.object_of != NO_OBJECT
        of = self.object_of
        return swapped[:, of] & belongs, donors[:, of], after[:, of]
