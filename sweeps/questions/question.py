"""What a sweep asks of a setting: which methods are played, what is measured, how it is told of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from sweeps.player import SpecPlayer
from sweeps.space import Fields

SHOWN = 10  # of the best trials


@dataclass(frozen=True)
class Metric:
    """A number that a trial comes to."""

    label: str  # of axes and columns
    maximised: bool
    by_episode: bool = False  # a difference between single episodes, as a pruner compares them


class Measured(Protocol):
    """How one setting did."""

    @property
    def method(self) -> str:
        """What was played, for a person."""

    def result(self, *names: str) -> Plain:
        """All metrics and what belongs to them; an interval's draws belong to these names."""

    def instances(self, places: dict[tuple[str, int], int]) -> dict[int, float]:
        """Place of a (task, episode) → what a pruner compares there; none if it cannot."""


S = TypeVar("S", bound=Measured)


class Question(ABC, Generic[S]):
    """One kind of sweep; `sweeps.questions` lists them."""

    main: str  # metric that figures and reports show first
    metrics: Mapping[str, Metric]
    shared: tuple[str, ...]  # methods under the base's models that all settings are compared with
    own: tuple[str, ...]  # methods that are played of each setting
    searched: tuple[str, ...]  # parts of a spec that change what the methods do

    @property
    def methods(self) -> tuple[str, ...]:
        return self.shared + self.own

    def check(self, spec: Spec, where: str) -> None:
        """UsageError where the search's tasks cannot answer."""

    @abstractmethod
    def play(
        self,
        player: SpecPlayer,
        base: Spec,
        candidates: Sequence[Fields],
        seeds: Sequence[int] | None,
    ) -> list[S]:
        """All candidates on the base's tasks and episodes, of all its seeds or some."""

    @abstractmethod
    def again(self, found: Plain, measured: S, base: S, *names: str) -> Plain:
        """A trial that was played again, beside what the search found and the base's setting."""

    @abstractmethod
    def headline(self, result: Plain) -> str:
        """ "gain +0.213 [+0.150, +0.270]": the main metric of a result."""

    @property
    @abstractmethod
    def note(self) -> str:
        """What the numbers are, for the head of a report."""

    @abstractmethod
    def seeds_note(self, seeds: int) -> str:
        """What so many seeds allow to say."""

    @abstractmethod
    def confirmed_lines(self, confirmed: Plain) -> Iterator[str]:
        """Markdown: what is left of the best trials where the search has never been."""

    @abstractmethod
    def trial_lines(self, objectives: Sequence[str], ranked: Sequence[Plain]) -> Iterator[str]:
        """Markdown: the best trials in the search."""
