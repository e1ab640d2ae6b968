"""Checkpoints of trainings: a killed one goes on from its last and ends with the same bytes.

Who starts trainings says how checkpoints are kept, with `checkpoints_by`. Without it none are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Protocol

import torch

from stitching.streams import Label


class Checkpoint(Protocol):
    """What one training has kept: tensors by name, and what is plain, as JSON has it."""

    def write(self, tensors: dict[str, torch.Tensor], plain: dict[str, Any]) -> None:
        """Replace what was kept; arrays in `plain` may come back as lists."""

    def tell(
        self, done: int, updates: int, curves: Mapping[str, Sequence[tuple[int, float]]]
    ) -> None:
        """How far the training is, after every update; nothing that is learned depends on it."""

    def read(self) -> tuple[dict[str, torch.Tensor], dict[str, Any]] | None:
        """What was written last; None where there is nothing, or nothing whole."""


Keeper = Callable[[tuple[Label, ...]], Checkpoint | None]
"""Finds the checkpoint of a training by its labels, which tell trainings of one artifact apart."""

_KEEPER: ContextVar[Keeper | None] = ContextVar("keeper", default=None)


@contextmanager
def checkpoints_by(keeper: Keeper) -> Iterator[None]:
    """Trainings within this context keep their checkpoints so, and go on from them."""
    token = _KEEPER.set(keeper)
    try:
        yield
    finally:
        _KEEPER.reset(token)


def checkpoint_of(labels: tuple[Label, ...]) -> Checkpoint | None:
    """That of the training with these labels; None where none are kept."""
    keeper = _KEEPER.get()
    return keeper(labels) if keeper else None
