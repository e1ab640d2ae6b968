"""Reach-Stitch: move the robot to where the next skill was demonstrated to begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.dynamics import Dynamics
from stitching.planning.imagining import imagined
from stitching.planning.objective import NORMS, Norm, spread_over_members
from stitching.planning.protocol import Planner
from stitching.stitchers import Proposal


@dataclass(frozen=True)
class Initiation:
    """The initiation sets of all skills (stitching.data.initiation), ready to be asked."""

    columns: list[int]  # of an observation, that make the robot's pose
    scale: Tensor  # (pose,) what they are divided by
    states: list[Tensor]  # by skill: (P, observation); none where nothing is known
    others: list[list[int]]  # by skill: columns of the objects that it is not about
    radii: list[float]  # ε by skill

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> Initiation:
        """From the artifact: columns, scale, radii, "states.<skill>", "others.<skill>"."""
        radii = arrays["radii"].tolist()
        return cls(
            arrays["columns"].tolist(),
            torch.from_numpy(arrays["scale"]),
            [torch.from_numpy(arrays[f"states.{skill}"]) for skill in range(len(radii))],
            [arrays[f"others.{skill}"].tolist() for skill in range(len(radii))],
            radii,
        )

    def distances(self, states: Tensor, skill: int) -> Tensor:
        """To the nearest pose of the set: (..., observation) → (...); 0 where it is empty."""
        if not len(self.states[skill]):
            return torch.zeros(states.shape[:-1])
        return self._gaps(states.flatten(0, -2), skill).amin(dim=1).unflatten(0, states.shape[:-1])

    def _gaps(self, states: Tensor, skill: int) -> Tensor:
        """Between poses, to each of the set: (n, observation) → (n, P)."""
        here, there = (each[:, self.columns] / self.scale for each in (states, self.states[skill]))
        # Without the matrix product, which is inexact near zero and taken by the number of rows.
        return torch.cdist(here, there, compute_mode="donot_use_mm_for_euclid_dist")

    def among_known_objects(self, states: Tensor, skill: int) -> Tensor:
        """The same robots among other objects: (n, observation) → (n, observation).

        Those that the skill is not about are as in that state of the set whose pose is nearest.
        """
        placed = states.clone()
        nearest = self.states[skill][self._gaps(states, skill).argmin(dim=1)]
        placed[:, self.others[skill]] = nearest[:, self.others[skill]]
        return placed

    def outside(self, states: Tensor, skill: int) -> Tensor:
        """Which states are farther than ε from the set, (n, observation) → (n,) bool."""
        return self.distances(states, skill) > self.radii[skill]


@dataclass(frozen=True)
class ReachStitch:
    """Plan towards the next skill's initiation set; nothing where the robot is in it already.

    A plan maximises E[−d(s')] − β·Var(T(s'|s, a)), on average over its steps: asked of its end
    alone, the first step, which is all that is executed, need not bring the robot nearer. Var(T) is
    that of Eq. 2; E is the mean over the members of the dynamics, each at its own s'. s is the
    present state with the objects that the next skill is not about as they were where it was
    demonstrated to begin: dynamics know nothing of cabinets that never stood open in the data, and
    the robot moves alike beside them.
    """

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = False  # values know nothing of where no data are
    initiation: Initiation
    dynamics: Dynamics
    planner: Planner
    actions: ActionSpace
    beta: float
    norm: Norm
    execute: int  # actions of each plan that are carried out
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        outside = self.initiation.outside(states, following)
        rows = outside.nonzero().flatten().tolist()
        actions = np.zeros((len(states), self.execute, self.actions.size), dtype=np.float32)
        if rows:
            known = self.initiation.among_known_objects(states[rows], following)
            score = imagined(known, self.actions, partial(self._imagine, following=following))
            plan = self.planner.plan(score, [streams[row] for row in rows], self.actions)
            actions[rows] = plan.actions[:, : self.execute].numpy()
        return Proposal(actions, outside.numpy())

    def _imagine(self, starts: Tensor, sequences: Tensor, following: int) -> Tensor:
        """The objective of sequences, (n, observation), (n, horizon, action) → (n,)."""
        path = self.dynamics.imagine_path(starts, sequences)  # (D, horizon, n, observation)
        nearness = -self.initiation.distances(path, following).mean(dim=0)  # (horizon, n)
        price = NORMS[self.norm](spread_over_members(self.dynamics.scaled(path)))
        return (nearness - self.beta * price).mean(dim=0)
