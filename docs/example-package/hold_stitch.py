"""Hold-Stitch: actions drawn by chance, each held for some steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from stitching.bounds import Amount, Few
from stitching.methods.protocol import Method, MethodSettings, Models, Proposal


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
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        drawn = np.stack([self.models.actions.uniform(rng, (1,)) for rng in streams])
        return Proposal.of(drawn.repeat(self.settings.hold, axis=1))


HOLD_STITCH = Method("Hold-Stitch", HoldStitchSettings, HoldStitch)
