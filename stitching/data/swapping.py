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
from stitching.models.scale import observation_scale

STILL = 0.1  # standard deviations of the dataset: a position that moves by less stands still
EACH = 0.5  # share of the objects that may be swapped which are


def bystanders(data: Transitions, factors: Factors, skills: Sequence[str]) -> np.ndarray:
    """Which objects play no part in each episode, (E, objects) bool.

    Those whose positions stand still throughout and are not what the demonstrated skill is about.
    None in an episode that demonstrates no skill. skills: their names, as `episode_skills` numbers
    them.
    """
    _, scale = observation_scale(data.observations)  # a number that only blurs has scale 1
    moved = _range(data) > STILL * scale  # (E, observation)
    positions = [list(factors.objects[name].positions) for name in factors.names]
    still = np.stack([~moved[:, own].any(axis=1) for own in positions], axis=1)
    for episode, skill in enumerate(data.episode_skills.tolist()):
        if skill < 0:
            still[episode] = False
        elif (own := factors.own.get(skills[skill])) is not None:
            still[episode, factors.names.index(own)] = False
    return still


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
    velocities that it has in a random state of the dataset, the same in s and s'.
    """

    share: float  # of the transitions, in [0, 1]
    object_of: np.ndarray  # (observation,) int64, the object of each column, NO_OBJECT for none
    bystanders: np.ndarray  # (N, objects) bool, by transition

    @classmethod
    def of(
        cls, data: Transitions, factors: Factors, skills: Sequence[str], share: float
    ) -> Swapping:
        lengths = np.diff(data.episode_ends, prepend=0)
        free = np.repeat(bystanders(data, factors, skills), lengths, axis=0)
        return cls(share, factors.object_of(data.observations.shape[1]), free)

    def draw(self, rows: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """For transitions (B,) int64: which numbers to swap, and the transitions to take them from.

        Returns (B, observation) bool and (B, observation) int64; numbers of one object come from
        one state.
        """
        total, objects = self.bystanders.shape
        swapped = rng.random((len(rows), 1)) < self.share
        swapped = swapped & (rng.random((len(rows), objects)) < EACH) & self.bystanders[rows]
        donors = rng.integers(total, size=(len(rows), objects))
        belongs = self.object_of != NO_OBJECT
        return swapped[:, self.object_of] & belongs, donors[:, self.object_of]
