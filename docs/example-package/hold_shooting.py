"""Hold-shooting: a planner that imagines single actions, each held for the whole horizon.

In a file that imports no method: methods that plan need to know every planner first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from stitching.bounds import Bounded, Count, Few
from stitching.envs.protocol import ActionSpace
from stitching.planning.protocol import PlannedActions, Score
from stitching.planning.ranking import sortable


@dataclass(frozen=True)
class HoldShooting(Bounded):
    """Draws actions uniformly, imagines each held for the whole horizon, and keeps the best."""

    population: Count = 50  # actions drawn a problem
    horizon: Few = 5  # steps for which each is held

    @property
    def samples(self) -> int:
        return self.population

    def can_search(self, actions: ActionSpace) -> bool:
        return True

    @torch.no_grad()
    def plan(
        self,
        score: Score,
        streams: Sequence[np.random.Generator],
        actions: ActionSpace,
        start: torch.Tensor | None = None,
    ) -> PlannedActions:
        drawn = np.empty((len(streams), self.population, 1, actions.size), dtype=np.float32)
        for row, stream in zip(drawn, streams, strict=True):
            row[:] = actions.uniform(stream, (self.population, 1))
        sequences = torch.from_numpy(drawn.repeat(self.horizon, axis=2))
        if start is not None:
            sequences[:, 0] = start
        problems = torch.arange(len(streams))
        scores = sortable(score(problems, sequences), problems)
        best = scores.argmax(dim=1)
        return PlannedActions(
            sequences[problems, best], scores[problems, best], torch.ones_like(problems)
        )
