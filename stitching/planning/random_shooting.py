"""Random shooting: the planner of MazeRunner (appendix B.2)."""

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
class RandomShooting(Bounded):
    """Draws action sequences uniformly and keeps the best; of equals, the first drawn."""

    population: Count = 200  # action sequences drawn a problem
    horizon: Few = 5  # actions in each sequence

    @property
    def samples(self) -> int:
        return self.population

    def can_search(self, actions: ActionSpace) -> bool:
        return True

    def plan(
        self,
        score: Score,
        streams: Sequence[np.random.Generator],
        actions: ActionSpace,
        start: torch.Tensor | None = None,
    ) -> PlannedActions:
        with torch.no_grad():
            problems = torch.arange(len(streams))
            sequences = self._draw(streams, actions)
            if start is not None:
                sequences[:, 0] = start
            scores = sortable(score(problems, sequences), problems)
            best = scores.argmax(dim=1)
            return PlannedActions(
                sequences[problems, best], scores[problems, best], torch.ones_like(problems)
            )

    def _draw(self, streams: Sequence[np.random.Generator], actions: ActionSpace) -> torch.Tensor:
        """(problems, population, horizon, action), row by row from its own stream."""
        shape = (self.population, self.horizon)
        # np.stack would refuse an empty list: there may be no problem to plan for.
        sequences = np.empty((len(streams), *shape, actions.size), dtype=np.float32)
        for row, stream in zip(sequences, streams, strict=True):
            row[:] = actions.uniform(stream, shape)
        return torch.from_numpy(sequences)
