"""MB-Stitch: plan towards high, certain value of the next skill (Eq. 2)."""

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
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.imagining import imagined
from stitching.planning.objective import Norm, Price, conservative_value
from stitching.planning.protocol import PlannedActions, Score


@dataclass(frozen=True)
class MBStitchSettings(PlanningSettings):
    """Tables 1 to 3, 7 and 9: the prices of Eq. 2, and how far a plan is followed."""

    limit: Amount = 5  # most stitching steps between two skills
    alpha: NotNegative = 1.0  # α of Eq. 2, price of the value ensemble's disagreement
    beta: NotNegative = 1.0  # β of Eq. 2, price of the dynamics ensemble's disagreement
    norm: Norm = "mean"  # how Eq. 2's second variance becomes a number
    selective: bool = False  # act only on plans that promise more than the present
    price: Price = "end"  # Var(T) of a plan: of its last state, or the mean over its steps


@dataclass(frozen=True)
class MBStitch:
    """Plan with the dynamics ensemble towards high, certain value of the next skill."""

    before_first: ClassVar[bool] = True
    until_value_falls: ClassVar[bool] = True
    settings: MBStitchSettings
    models: Models

    @property
    def limit(self) -> int:
        return self.settings.limit

    @property
    def agent(self) -> Agent:
        return self.models.agent

    @cached_property
    def dynamics(self) -> Dynamics:
        return self.models.one("dynamics", Dynamics)

    @cached_property
    def _critic(self) -> Agent:
        """The agent as plans are judged by it: as precise as what they are imagined with."""
        return self.agent.at_precision(self.dynamics.precision)

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        return self.proposal(self.plan(states, following, streams), states, following)

    def plan(
        self, states: torch.Tensor, following: int, streams: Sequence[np.random.Generator]
    ) -> PlannedActions:
        """The plan from each of the states (n, observation) that promises most by Eq. 2."""
        score = self.score(states, following)
        return self.settings.chosen.plan(score, streams, self.models.actions)

    def proposal(self, plan: PlannedActions, states: torch.Tensor, following: int) -> Proposal:
        """What is carried out of the plan, and from which of the states."""
        actions = plan.actions[:, : self.settings.execute].numpy()
        if not self.settings.selective:
            return Proposal.of(actions)
        return Proposal(actions, (plan.objective > self.present(states, following)).numpy())

    def present(self, states: torch.Tensor, following: int) -> torch.Tensor:
        """Eq. 2 of states themselves, (n, observation) → (n,): nothing there is predicted."""
        return self._equation_2(self._critic.values(states, following), states[None])

    def score(self, states: torch.Tensor, following: int) -> Score:
        """Eq. 2 of each imagined action sequence, every member on its own path."""
        return imagined(states, self.models.actions, partial(self._imagine, following=following))

    def _imagine(
        self, starts: torch.Tensor, sequences: torch.Tensor, following: int
    ) -> torch.Tensor:
        """Eq. 2 of sequences, (n, observation), (n, horizon, action) → (n,).

        The value is always that of the last state.
        """
        if self.settings.price == "end":
            end = self.dynamics.imagine(starts, sequences)  # (D, n, observation)
            return self._equation_2(self._values(end, following), self.dynamics.scaled(end))
        path = self.dynamics.imagine_path(starts, sequences)  # (D, horizon, n, observation)
        values = self._values(path[:, -1], following)
        # The value is the same at every step's price, so the mean is over prices alone.
        return self._equation_2(values, self.dynamics.scaled(path)).mean(dim=0)

    def _values(self, predicted: torch.Tensor, following: int) -> torch.Tensor:
        """By each value member at the mean predicted state: (D, n, observation) → (M, n)."""
        return self._critic.values(predicted.mean(dim=0), following)

    def _equation_2(self, values: torch.Tensor, predicted: torch.Tensor) -> torch.Tensor:
        """Of values (M, n) and scaled predictions (D, ..., n, observation), under the settings."""
        one = self.settings
        return conservative_value(values, predicted, one.alpha, one.beta, one.norm)


MB_STITCH = Method("MB-Stitch", MBStitchSettings, MBStitch, needs=("dynamics",))
