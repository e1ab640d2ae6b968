"""Per-dimension normalisation of observations."""

from __future__ import annotations

import numpy as np

SMALLEST_SCALE = 1e-4


def observation_scale(observations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of each dimension of a dataset, (observation,) float32 each.

    Constant dimensions get scale 1: dividing by their rounding noise would magnify it.
    """
    std = observations.std(axis=0, dtype=np.float64)
    std = np.where(std < SMALLEST_SCALE, 1.0, std)
    return observations.mean(axis=0, dtype=np.float64).astype(np.float32), std.astype(np.float32)


def observation_range(*states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest value of each dimension, of states (n, observation): (observation,)."""
    low = np.minimum.reduce([part.min(axis=0) for part in states])
    high = np.maximum.reduce([part.max(axis=0) for part in states])
    return low.astype(np.float32), high.astype(np.float32)
