"""One recorded episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Recording:
    """T actions, what was seen around them, and what the episode shows as far as anybody says."""

    observations: np.ndarray  # (T + 1, observation) of floats
    actions: np.ndarray  # (T, action) of floats
    skill: str | None = None  # its name; "" where it shows none; None where that is not said
    success: bool = True  # whether the last action achieves the skill

    def __len__(self) -> int:
        return len(self.actions)


def first_not_finite(array: np.ndarray) -> int | None:
    """The first row of (N, width) with a number that float32, as models have it, cannot hold."""
    finite = (np.abs(array) <= np.finfo(np.float32).max).all(axis=1)
    return None if finite.all() else int(finite.argmin())
