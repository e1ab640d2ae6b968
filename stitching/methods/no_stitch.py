"""No-Stitch: direct chaining, the baseline of every table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from stitching.methods.protocol import Method, MethodSettings, Models, Proposal


@dataclass(frozen=True)
class NoStitchSettings(MethodSettings):
    """Direct chaining has nothing to set."""


@dataclass(frozen=True)
class NoStitch:
    """The next skill starts where the last one ended."""

    before_first: ClassVar[bool] = False
    until_value_falls: ClassVar[bool] = True
    settings: MethodSettings = NoStitchSettings()
    models: Models | None = None  # it asks none
    limit: ClassVar[int] = 0

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        raise AssertionError("No-Stitch takes no stitching steps")


NO_STITCH = Method("No-Stitch", NoStitchSettings, NoStitch)
