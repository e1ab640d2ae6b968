"""A score of action sequences from what a learned model imagines of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import torch

from stitching.envs.protocol import ActionSpace
from stitching.planning.protocol import Score

Judge: TypeAlias = "Callable[[torch.Tensor, torch.Tensor], torch.Tensor]"
"""judge(starts, sequences) -> scores: (n, observation), (n, horizon, action) → (n,)."""


def imagined(states: torch.Tensor, actions: ActionSpace, judge: Judge) -> Score:
    """What planners ask for: the judgement of each sequence from its problem's state.

    states: (problems, observation).
    """

    def score(problems: torch.Tensor, sampled: torch.Tensor) -> torch.Tensor:
        population = sampled.shape[1]
        starts = states[problems].repeat_interleave(population, dim=0)
        sequences = sampled.flatten(0, 1)  # (problems · population, horizon, action)
        if not actions.discrete:
            return judge(starts, sequences).unflatten(0, (-1, population))
        # Few distinct sequences, and often one start for all: imagine each but once.
        starts, sequences, inverse = distinct(starts, sequences)
        return judge(starts, sequences)[inverse].unflatten(0, (-1, population))

    return score


def distinct(
    starts: torch.Tensor, sequences: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Distinct pairs of start and sequence, and where each of the n given pairs went, (n,)."""
    pairs = torch.cat([starts, sequences.flatten(1)], dim=1)
    unique, inverse = pairs.unique(dim=0, return_inverse=True)
    width = starts.shape[1]
    return unique[:, :width], unique[:, width:].unflatten(1, sequences.shape[1:]), inverse
