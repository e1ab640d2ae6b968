"""What every training loop here needs: a decaying rate, learning curves, and an outcome."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from torch import Tensor

Curves = dict[str, list[tuple[int, float]]]


@dataclass(frozen=True)
class Trained:
    """Weights by name, input normaliser included, and learning curves by name."""

    weights: dict[str, np.ndarray]
    curves: Curves


@dataclass
class CurveLog:
    """Collects (update, value) every `every` updates and at the last one.

    Raises FloatingPointError when a value stops being finite, naming it and the update.
    """

    updates: int
    every: int
    curves: Curves = field(default_factory=dict)

    def record(self, update: int, values: dict[str, Tensor]) -> None:
        done = update + 1
        if done % self.every and done != self.updates:
            return
        for name, tensor in values.items():
            if not math.isfinite(value := tensor.item()):
                raise FloatingPointError(f"training diverged: {name} is {value} at update {done}")
            self.curves.setdefault(name, []).append((done, value))


def cosine(update: int, updates: int) -> float:
    """Factor of the learning rate: from 1 at the first update towards 0 at the last."""
    return (1 + math.cos(math.pi * update / updates)) / 2
