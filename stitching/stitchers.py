"""The four methods of joining neighbouring skills (paper 4.1.2) behind one protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.objective import Norm, conservative_value
from stitching.planning.protocol import Planner, Score


class Stitcher(Protocol):
    """Chooses the actions between two skills."""

    @property
    def limit(self) -> int:
        """The most steps one stitch may take."""
        ...

    def propose(
        self,
        states: Tensor,
        previous: int,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> np.ndarray:
        """Actions to execute before the value is looked at again.

        states (n, observation) and one stream per row → (n, steps, action) float32, steps ≥ 1.
        """


@dataclass(frozen=True)
class NoStitch:
    """The next skill starts where the last one ended."""

    limit: int = 0

    def propose(
        self,
        states: Tensor,
        previous: int,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> np.ndarray:
        raise AssertionError("No-Stitch takes no stitching steps")


@dataclass(frozen=True)
class RandomStitch:
    """Uniform random actions, under the same stop rule as MB-Stitch."""

    actions: ActionSpace
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> np.ndarray:
        return np.stack([self.actions.uniform(rng, (1,)) for rng in streams])


@dataclass(frozen=True)
class MFStitch:
    """An extra policy learned from the mixed data of both skills; conditioned on the pair."""

    policy: Agent
    pairs: dict[tuple[int, int], int]  # (previous, following) → the policy's condition
    actions: ActionSpace
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> np.ndarray:
        noise = policy_noise(self.actions, streams)
        return self.policy.act(states, self.pairs[previous, following], noise)[:, None]


@dataclass(frozen=True)
class MBStitch:
    """Ours: plan with the dynamics ensemble towards high, certain value of the next skill."""

    agent: Agent
    dynamics: Dynamics
    planner: Planner
    actions: ActionSpace
    alpha: float
    beta: float
    norm: Norm
    execute: int  # actions of each plan that are carried out: all in the maze, 1 under CEM
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> np.ndarray:
        plan = self.planner.plan(self.score(states, following), streams, self.actions)
        return plan.actions[:, : self.execute].numpy()

    def score(self, states: Tensor, following: int) -> Score:
        """Eq. 2 at the end of each imagined action sequence, every member on its own path."""

        def score(problems: Tensor, actions: Tensor) -> Tensor:
            population, horizon = actions.shape[1], actions.shape[2]
            sequences = actions.flatten(0, 1)  # (problems · population, horizon, action)
            imagined = states[problems].repeat_interleave(population, dim=0).unsqueeze(0)
            for step in range(horizon):
                imagined = self.dynamics(imagined, sequences[:, step])  # (D, n, observation)
            values = self.agent.values(imagined.mean(dim=0), following)  # (M, n)
            scores = conservative_value(
                values, self.dynamics.scaled(imagined), self.alpha, self.beta, self.norm
            )
            return scores.unflatten(0, (-1, population))

        return score


def policy_noise(actions: ActionSpace, streams: Sequence[np.random.Generator]) -> np.ndarray:
    """One step's sampling noise from each stream: (n, 1) uniform, or (n, action) normal."""
    if actions.discrete:
        return np.array([[rng.random()] for rng in streams], dtype=np.float32)
    return np.stack([rng.standard_normal(actions.size, dtype=np.float32) for rng in streams])
