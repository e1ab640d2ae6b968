"""Reach-Stitch: move the robot to where the next skill was demonstrated to begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
import torch

from stitching.bounds import Amount, NotNegative
from stitching.methods.planning import PlanningSettings
from stitching.methods.protocol import Method, Models, Proposal
from stitching.models.dynamics import Dynamics
from stitching.models.initiation import Initiation
from stitching.planning.cem import CEM
from stitching.planning.imagining import imagined
from stitching.planning.objective import NORMS, Norm, spread_over_members


@dataclass(frozen=True)
class ReachStitchSettings(PlanningSettings):
    """How a plan towards the next skill's initiation set is searched and priced."""

    limit: Amount = 20  # most stitching steps before a skill
    beta: NotNegative = 0.5  # β of Eq. 2, beside a distance in standard deviations
    norm: Norm = "mean"  # as MB-Stitch's
    steered: bool = True  # search around the actions that a linear model of the robot has
    cem: CEM = CEM(horizon=2, iterations=10, momentum=0.5, tolerance=0.05)


@dataclass(frozen=True)
class ReachStitch:
    """Plan towards the next skill's initiation set; nothing where the robot is in it already.

    A plan maximises E[−d(s')] − β·Var(T(s'|s, a)), on average over its steps: asked of its end
    alone, the first step, which is all that is executed, need not bring the robot nearer. Var(T) is
    that of Eq. 2; E is the mean over the members of the dynamics, each at its own s'. s is the
    present state with the objects that the next skill is not about as they were where it was
    demonstrated to begin: dynamics know nothing of cabinets that never stood open in the data, and
    the robot moves alike beside them.

    Where actions are continuous the search begins around those by which a linear model of the robot
    comes to the nearest pose of the set: eighteen numbers are many for fifty samples.
    """

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = False  # values know nothing of where no data are
    settings: ReachStitchSettings
    models: Models

    @property
    def limit(self) -> int:
        return self.settings.limit

    @cached_property
    def _initiation(self) -> Initiation:
        return self.models.one("initiation-sets", Initiation)

    @cached_property
    def _dynamics(self) -> Dynamics:
        return self.models.one("dynamics", Dynamics)

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        outside = self._initiation.outside(states, following)
        rows = outside.nonzero().flatten().tolist()
        space, execute = self.models.actions, self.settings.execute
        actions = np.zeros((len(states), execute, space.size), dtype=np.float32)
        if rows:
            begun = states[rows]
            nearest = self._initiation.nearest(begun, following)
            known = self._initiation.among_known_objects(begun, nearest, following)
            score = imagined(known, space, partial(self._imagine, following=following))
            planner, start = self.settings.chosen, None
            if self.settings.steered:
                start = self._initiation.towards(begun, nearest, planner.horizon)
            plan = planner.plan(score, [streams[row] for row in rows], space, start)
            actions[rows] = plan.actions[:, :execute].numpy()
        return Proposal(actions, outside.numpy())

    def _imagine(
        self, starts: torch.Tensor, sequences: torch.Tensor, following: int
    ) -> torch.Tensor:
        """The objective of sequences, (n, observation), (n, horizon, action) → (n,)."""
        path = self._dynamics.imagine_path(starts, sequences)  # (D, horizon, n, observation)
        nearness = -self._initiation.distances(path, following).mean(dim=0)  # (horizon, n)
        price = NORMS[self.settings.norm](spread_over_members(self._dynamics.scaled(path)))
        return (nearness - self.settings.beta * price).mean(dim=0)


REACH_STITCH = Method(
    "Reach-Stitch", ReachStitchSettings, ReachStitch, needs=("dynamics", "initiation-sets")
)
