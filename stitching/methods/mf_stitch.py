"""MF-Stitch: a policy learned from the data of both neighbouring skills (paper 4.1.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import torch

from stitching.bounds import Amount
from stitching.data.mixtures import Mixture, skill_pairs
from stitching.envs.protocol import Benchmark
from stitching.methods.protocol import Method, MethodSettings, Models, Proposal
from stitching.models.agent import Agent
from stitching.models.iql import IQLConfig


@dataclass(frozen=True)
class MFStitchSettings(MethodSettings):
    """The extra policy between two skills, and what it is learned from."""

    limit: Amount = 5  # most stitching steps between two skills
    mixture: Mixture = "fine-tuned"  # how the paper's "mixed" dataset is read
    training: IQLConfig = IQLConfig()  # the extra policy, learned from it

    def check(self, benchmark: Benchmark, agent: IQLConfig) -> None:
        """Refuse to fine-tune a policy that could not be the one that the skills are learned by."""
        if self.training.alters:
            raise ValueError("training: only the agent learns with swap and corrections")
        if self.mixture != "fine-tuned":
            return
        if self.training.policy_hidden != agent.policy_hidden:
            raise ValueError(
                f"training: hidden layers of {self.training.policy_hidden} cannot be fine-tuned "
                f"from the skills' policy with {agent.policy_hidden}; set policy_width and "
                "policy_layers to the agent's, or another mixture"
            )
        if self.training.multi_task and not agent.multi_task:
            raise ValueError(
                "training: skills with a policy each are fine-tuned pair by pair; set multi_task "
                "to false, or another mixture"
            )


@dataclass(frozen=True)
class MFStitch:
    """The mode of an extra policy learned from the mixed data; conditioned on the pair."""

    before_first: ClassVar[bool] = False  # there is no pair
    until_value_falls: ClassVar[bool] = True
    settings: MFStitchSettings
    models: Models

    @property
    def limit(self) -> int:
        return self.settings.limit

    @cached_property
    def _policy(self) -> Agent:
        return self.models.one("mf-policy", Agent)

    @cached_property
    def _pairs(self) -> dict[tuple[int, int], int]:
        """(previous, following) → the policy's condition."""
        return {pair: row for row, pair in enumerate(skill_pairs(self.models.skills))}

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        assert previous is not None
        actions = self._policy.act(states, self._pairs[previous, following], noise=None)
        return Proposal.of(actions[:, None])


MF_STITCH = Method("MF-Stitch", MFStitchSettings, MFStitch, needs=("mf-policy",))
