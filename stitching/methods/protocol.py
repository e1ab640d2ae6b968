"""What a method of joining skills is: its settings, its stitcher, and what it must have trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
import torch

from stitching.bounds import Bounded
from stitching.envs.protocol import ActionSpace, Benchmark
from stitching.models.agent import Agent
from stitching.models.iql import IQLConfig

M = TypeVar("M")

SKILLS = "agent"
"""The kind of model whose policies are told which skill is asked for."""


@dataclass(frozen=True)
class Proposal:
    """What a stitcher would do from n states."""

    actions: np.ndarray  # (n, steps, action) float32, steps ≥ 1
    wanted: np.ndarray  # (n,) bool; where False the stitch ends here, untaken if it had not begun

    @classmethod
    def of(cls, actions: np.ndarray) -> Proposal:
        """Actions that are all to be taken."""
        return cls(actions, np.ones(len(actions), dtype=bool))


@dataclass(frozen=True)
class Models:
    """What a stitcher is played with."""

    actions: ActionSpace  # of the benchmark
    skills: int  # how many the benchmark has
    trained: Mapping[str, Any]  # by kind: those that the method asks for

    def one(self, kind: str, expected: type[M]) -> M:
        """The model of a kind.

        Raises TypeError where it is not as expected, KeyError where the method does not need it.
        """
        if kind not in self.trained:
            raise KeyError(f"{kind}: not among what the method needs")
        model = self.trained[kind]
        if not isinstance(model, expected):
            raise TypeError(f"{kind}: expected {expected.__name__}, got {type(model).__name__}")
        return model

    @property
    def agent(self) -> Agent:
        """The skills' policies and values."""
        return self.one(SKILLS, Agent)


class Stitcher(Protocol):
    """Chooses the actions that lead to a skill, and whether there are to be any."""

    before_first: ClassVar[bool]  # it can stitch to a task's first skill, which follows none
    until_value_falls: ClassVar[bool]  # its stitches end where the next skill's value rises no more

    def __init__(self, settings: Any, models: Models) -> None:
        """Settings are those of its method."""

    @property
    def limit(self) -> int:
        """The most steps one stitch may take."""
        ...

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        """Actions to execute before the value is looked at again.

        For states (n, observation), with one stream each. previous: None before a first skill.
        Steps beyond `limit` are dropped. A stitcher keeps nothing from call to call.
        """


class MethodSettings(Bounded):
    """What the settings of every method inherit from, as frozen dataclasses with defaults."""

    def check(self, benchmark: Benchmark, agent: IQLConfig) -> None:
        """Raise ValueError where they do not fit the benchmark or how the skills are learned."""

    @property
    def without_effect(self) -> frozenset[str]:
        """Fields that decide nothing while the others are as they are."""
        return frozenset()


@dataclass(frozen=True)
class Method:
    """How neighbouring skills are joined, as tables know it."""

    label: str  # as tables print it
    settings: type[MethodSettings]
    stitcher: type[Stitcher]
    needs: tuple[str, ...] = ()  # kinds of models beside the policy
    policy: str = SKILLS  # kind of the model that executes skills

    @property
    def told(self) -> bool:
        """Whether its policy is told which skill is asked for."""
        return self.policy == SKILLS

    @property
    def models(self) -> tuple[str, ...]:
        """Kinds of the models that it is played with."""
        return (self.policy, *self.needs)

    @property
    def modules(self) -> set[str]:
        """Whose code, with all that they import, decides what the method does."""
        return {self.settings.__module__, self.stitcher.__module__}
