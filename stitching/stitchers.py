"""The four methods of joining neighbouring skills (paper 4.1.2) behind one protocol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar, Protocol

import numpy as np
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.imagining import imagined
from stitching.planning.objective import Norm, Price, conservative_value
from stitching.planning.protocol import Planner, Score


@dataclass(frozen=True)
class Proposal:
    """What a stitcher would do from n states."""

    actions: np.ndarray  # (n, steps, action) float32, steps ≥ 1
    wanted: np.ndarray  # (n,) bool; where False the stitch ends here, untaken if it had not begun

    @classmethod
    def of(cls, actions: np.ndarray) -> Proposal:
        """Actions that are all to be taken."""
        return cls(actions, np.ones(len(actions), dtype=bool))


class Stitcher(Protocol):
    """Chooses the actions that lead to a skill, and whether there are to be any."""

    before_first: ClassVar[bool]  # it can stitch to a task's first skill, which follows none
    until_value_falls: ClassVar[bool]  # its stitches end where the next skill's value rises no more

    @property
    def limit(self) -> int:
        """The most steps one stitch may take."""
        ...

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        """Actions to execute before the value is looked at again.

        For states (n, observation), with one stream each. previous: None before a first skill.
        """


@dataclass(frozen=True)
class NoStitch:
    """The next skill starts where the last one ended."""

    before_first: ClassVar[bool] = False
    until_value_falls: ClassVar[bool] = True
    limit: int = 0

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        raise AssertionError("No-Stitch takes no stitching steps")


@dataclass(frozen=True)
class RandomStitch:
    """Uniform random actions, under the same stop rule as MB-Stitch."""

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = True
    actions: ActionSpace
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        return Proposal.of(np.stack([self.actions.uniform(rng, (1,)) for rng in streams]))


@dataclass(frozen=True)
class MFStitch:
    """The mode of an extra policy learned from the mixed data; conditioned on the pair."""

    before_first: ClassVar[bool] = False  # there is no pair
    until_value_falls: ClassVar[bool] = True
    policy: Agent
    pairs: dict[tuple[int, int], int]  # (previous, following) → the policy's condition
    limit: int

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        assert previous is not None
        actions = self.policy.act(states, self.pairs[previous, following], noise=None)
        return Proposal.of(actions[:, None])


@dataclass(frozen=True)
class MBStitch:
    """Ours: plan with the dynamics ensemble towards high, certain value of the next skill."""

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = True
    agent: Agent
    dynamics: Dynamics
    planner: Planner
    actions: ActionSpace
    alpha: float
    beta: float
    norm: Norm
    execute: int  # actions of each plan that are carried out: all in the maze, 1 under CEM
    limit: int
    selective: bool = False  # act only on plans that promise more than the state they start from
    price: Price = "end"  # which imagined states' Var(T) a plan pays for

    @cached_property
    def _critic(self) -> Agent:
        """The agent as plans are judged by it: as precise as what they are imagined with."""
        return self.agent.at_precision(self.dynamics.precision)

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        plan = self.planner.plan(self.score(states, following), streams, self.actions)
        actions = plan.actions[:, : self.execute].numpy()
        if not self.selective:
            return Proposal.of(actions)
        return Proposal(actions, (plan.objective > self.present(states, following)).numpy())

    def present(self, states: Tensor, following: int) -> Tensor:
        """Eq. 2 of states themselves, (n, observation) → (n,): nothing there is predicted."""
        values = self._critic.values(states, following)
        return conservative_value(values, states[None], self.alpha, self.beta, self.norm)

    def score(self, states: Tensor, following: int) -> Score:
        """Eq. 2 of each imagined action sequence, every member on its own path."""
        return imagined(states, self.actions, partial(self._imagine, following=following))

    def _imagine(self, starts: Tensor, sequences: Tensor, following: int) -> Tensor:
        """Eq. 2 of sequences, (n, observation), (n, horizon, action) → (n,).

        The value is always that of the last state.
        """
        if self.price == "end":
            end = self.dynamics.imagine(starts, sequences)  # (D, n, observation)
            return self._conservative_value(end, end, following)
        path = self.dynamics.imagine_path(starts, sequences)  # (D, horizon, n, observation)
        # The value is the same at every step's price, so the mean is over prices alone.
        return self._conservative_value(path[:, -1], path, following).mean(dim=0)

    def _conservative_value(self, end: Tensor, predicted: Tensor, following: int) -> Tensor:
        """Eq. 2: the value at `end` (D, n, observation), the price of (D, ..., n, observation)."""
        return conservative_value(
            self._critic.values(end.mean(dim=0), following),  # (M, n)
            self.dynamics.scaled(predicted),
            self.alpha,
            self.beta,
            self.norm,
        )


def policy_noise(actions: ActionSpace, streams: Sequence[np.random.Generator]) -> np.ndarray:
    """One step's sampling noise from each stream: (n, 1) uniform, or (n, action) normal."""
    if actions.discrete:
        return np.array([[rng.random()] for rng in streams], dtype=np.float32)
    return np.stack([rng.standard_normal(actions.size, dtype=np.float32) for rng in streams])
