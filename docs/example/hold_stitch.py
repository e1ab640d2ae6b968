"""Actions that are held: a method that holds one drawn by chance, a planner that searches them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from stitching.bounds import Amount, Bounded, Count, Few
from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Method, MethodSettings, Models, Proposal
from stitching.planning.protocol import Plan, Score
from stitching.planning.ranking import rankable


@dataclass(frozen=True)
class HoldStitchSettings(MethodSettings):
    limit: Amount = 6  # most stitching steps between two skills
    hold: Few = 3  # steps for which an action is held


@dataclass(frozen=True)
class HoldStitch:
    """One uniform random action, held, and then another."""

    before_first: ClassVar[bool] = False
    until_value_falls: ClassVar[bool] = True
    settings: HoldStitchSettings
    models: Models

    @property
    def limit(self) -> int:
        return self.settings.limit

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        drawn = np.stack([self.models.actions.uniform(rng, (1,)) for rng in streams])
        return Proposal.of(drawn.repeat(self.settings.hold, axis=1))


HOLD_STITCH = Method("Hold-Stitch", HoldStitchSettings, HoldStitch)


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
        self, score: Score, streams: Sequence[np.random.Generator], actions: ActionSpace
    ) -> Plan:
        drawn = np.empty((len(streams), self.population, 1, actions.size), dtype=np.float32)
        for row, stream in zip(drawn, streams, strict=True):
            row[:] = actions.uniform(stream, (self.population, 1))
        sequences = torch.from_numpy(drawn.repeat(self.horizon, axis=2))
        problems = torch.arange(len(streams))
        scores = rankable(score(problems, sequences), problems)
        best = scores.argmax(dim=1)
        return Plan(sequences[problems, best], scores[problems, best], torch.ones_like(problems))
