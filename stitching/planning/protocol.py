"""What a planner is: it turns a score of action sequences into one plan a problem.

A *problem* is one episode that is waiting for a plan. All problems of a block are planned
together, so scores are a few large tensor operations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
import torch

from stitching.envs.protocol import ActionSpace

Score: TypeAlias = "Callable[[torch.Tensor, torch.Tensor], torch.Tensor]"
"""score(problems, actions) -> scores, to be maximised.

problems: (open,) int64, indices into `streams` of the problems that are still being planned.
actions:  (open, population, horizon, action) float32, on the CPU.
scores:   (open, population) float32, on the CPU.
"""


@dataclass(frozen=True)
class PlannedActions:
    """The outcome of planning, one row a problem."""

    actions: torch.Tensor  # (problems, horizon, action) float32: what to execute
    objective: torch.Tensor  # (problems,) float32: the score of `actions`
    iterations: torch.Tensor  # (problems,) int64: populations sampled


class Planner(Protocol):
    """Searches for the action sequence with the highest score.

    A planner is settings and nothing else, a frozen dataclass, so that a spec can hold one: what it
    plans for arrives with each call. PLANNERS (stitching.planning.registry) has them by name.
    """

    @property
    def horizon(self) -> int:
        """Actions in each sequence."""
        ...

    @property
    def samples(self) -> int:
        """The most action sequences that one plan takes."""
        ...

    def can_search(self, actions: ActionSpace) -> bool:
        """Whether it can plan actions of this kind."""
        ...

    def plan(
        self,
        score: Score,
        streams: Sequence[np.random.Generator],
        actions: ActionSpace,
        start: torch.Tensor | None = None,
    ) -> PlannedActions:
        """One plan for each stream.

        start: (problems, horizon, action), what is known to be a fair plan: the search begins
        around it, or tries it as well. None: it begins as it does by itself.

        A problem draws from its own stream only, and only as much as it needs itself, so its
        plan does not depend on which other problems share the batch.

        Raises:
            ValueError: the planner cannot search actions of this kind.
            FloatingPointError: no action sequence of some problem has a finite score.
        """
