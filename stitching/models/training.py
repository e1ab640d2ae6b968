"""What every training loop here needs: updates that can be resumed, a rate, curves, an outcome."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import torch

from stitching.models.checkpoints import Checkpoint, checkpoint_of
from stitching.streams import Label

DRAWN_AT_ONCE = 256
"""Minibatches may be drawn this many at once; a checkpoint lies between two such draws."""

SECONDS_BETWEEN_CHECKPOINTS = 60.0

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

    def record(self, update: int, values: dict[str, torch.Tensor]) -> None:
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


@dataclass(frozen=True)
class Training:
    """All that changes from one update to the next: what a checkpoint keeps."""

    labels: tuple[Label, ...]  # tell trainings of one artifact apart
    tensors: dict[str, torch.Tensor]  # what the updates change in place
    optimizer: torch.optim.Optimizer
    batches: np.random.Generator
    log: CurveLog
    dropout: torch.Generator | None = None

    def updates(self) -> Iterator[int]:
        """The numbers of the updates that are left, from the last checkpoint on.

        Leaves a checkpoint about once a minute (see `checkpoints_by`). When one is left depends on
        the clock; what comes out does not.
        """
        checkpoint = checkpoint_of(self.labels)
        first = self._go_on(checkpoint) if checkpoint else 0
        kept = time.monotonic()
        for update in range(first, self.log.updates):
            yield update
            if checkpoint is None:
                continue
            done = update + 1
            checkpoint.tell(done, self.log.updates, self.log.curves)
            due = time.monotonic() - kept >= SECONDS_BETWEEN_CHECKPOINTS
            if due and (done % DRAWN_AT_ONCE == 0 or done == self.log.updates):
                self._keep(checkpoint, done)
                kept = time.monotonic()

    def _keep(self, checkpoint: Checkpoint, done: int) -> None:
        tensors = {f"model.{name}": tensor for name, tensor in self.tensors.items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        if self.dropout is not None:
            tensors["dropout"] = self.dropout.get_state()
        plain = {
            "done": done,
            "batches": self.batches.bit_generator.state,
            "curves": self.log.curves,
        }
        checkpoint.write(tensors, plain)

    def _go_on(self, checkpoint: Checkpoint) -> int:
        """Everything as the checkpoint has it; returns how many updates that were."""
        found = checkpoint.read()
        if found is None:
            return 0
        tensors, plain = found
        states: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in tensors.items():
            if name.startswith("optimizer."):
                _, number, kind = name.split(".")
                states.setdefault(int(number), {})[kind] = value
        groups = self.optimizer.state_dict()["param_groups"]
        self.optimizer.load_state_dict({"state": states, "param_groups": groups})
        with torch.no_grad():
            for name, tensor in self.tensors.items():
                tensor.copy_(tensors[f"model.{name}"])
        if self.dropout is not None:
            self.dropout.set_state(tensors["dropout"])
        self.batches.bit_generator.state = plain["batches"]
        self.log.curves.update(
            {name: [(at, value) for at, value in curve] for name, curve in plain["curves"].items()}
        )
        return int(plain["done"])
