"""How far states are from those in which a skill was demonstrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from stitching.data.transitions import Transitions
from stitching.models.dynamics import Dynamics

SAMPLED_STATES = 200  # of a skill's demonstrations, to say how near to one another they are


@dataclass(frozen=True)
class DemonstratedStates:
    """The states in which one skill was demonstrated, and how far from them others are.

    Distances are Euclidean, every dimension in units of its standard deviation in the data, over
    the square root of their number: 1 is one standard deviation in every dimension.
    """

    states: torch.Tensor  # (N, observation), in those units
    demonstrations: torch.Tensor  # (N,) int64, which of them each state is of

    @classmethod
    def of(cls, data: Transitions, skill: int, dynamics: Dynamics) -> DemonstratedStates:
        rows = data.episode_rows(skill)
        numbers = np.repeat(np.arange(len(rows)), [len(each) for each in rows])
        chosen = np.concatenate([np.empty(0, dtype=np.int64), *rows])
        states = dynamics.scaled(torch.from_numpy(data.observations[chosen]))
        return cls(states, torch.from_numpy(numbers))

    def distances(self, states: torch.Tensor) -> torch.Tensor:
        """To the nearest demonstrated state: (n, observation), in the data's units → (n,)."""
        return self._gaps(states).amin(dim=1)

    def typical(self) -> float | None:
        """Median distance of a demonstrated state to the nearest one of another demonstration.

        None where there is but one. Of at most 200 states, evenly chosen.
        """
        if self.demonstrations.unique().numel() < 2:
            return None
        count = len(self.states)
        shown = torch.linspace(0, count - 1, min(SAMPLED_STATES, count)).long()
        same = self.demonstrations[shown][:, None] == self.demonstrations
        gaps = self._gaps(self.states[shown]).masked_fill(same, torch.inf)
        return float(gaps.amin(dim=1).median())

    def _gaps(self, states: torch.Tensor) -> torch.Tensor:
        """(n, observation) → (n, N). Without the matrix product, which is inexact near zero."""
        exact = "donot_use_mm_for_euclid_dist"
        return torch.cdist(states, self.states, compute_mode=exact) / states.shape[1] ** 0.5
