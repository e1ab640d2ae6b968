"""Random-Stitch: what stitching by chance brings (paper 4.1.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from stitching.bounds import Amount
from stitching.methods.protocol import Method, MethodSettings, Models, Proposal


@dataclass(frozen=True)
class RandomStitchSettings(MethodSettings):
    """How long chance may act."""

    limit: Amount = 5  # most stitching steps between two skills


@dataclass(frozen=True)
class RandomStitch:
    """Uniform random actions, under the same stop rule as MB-Stitch."""

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = True
    settings: RandomStitchSettings
    models: Models

    @property
    def limit(self) -> int:
        return self.settings.limit

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        return Proposal.of(np.stack([self.models.actions.uniform(rng, (1,)) for rng in streams]))


RANDOM_STITCH = Method("Random-Stitch", RandomStitchSettings, RandomStitch)
