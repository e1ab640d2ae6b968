"""What the settings of all methods that plan have in common."""

from __future__ import annotations

from dataclasses import dataclass

from stitching.bounds import Few
from stitching.envs.protocol import Benchmark
from stitching.methods.protocol import MethodSettings
from stitching.models.iql import IQLConfig
from stitching.planning.registry import PLANNERS, PlannerChoice
from stitching.registry import field_name


@dataclass(frozen=True)
class PlanningSettings(PlannerChoice, MethodSettings):
    """A planner and its settings; each method declares its own defaults."""

    execute: Few = 1  # actions of each plan carried out before planning again

    def check(self, benchmark: Benchmark, agent: IQLConfig) -> None:
        """Refuse a planner that cannot search the benchmark's actions, or plans too few."""
        if self.execute > self.chosen.horizon:
            raise ValueError(
                f"execute: a plan of {self.planner} has {self.chosen.horizon} actions, so "
                f"{self.execute} cannot be carried out"
            )
        if self.chosen.can_search(benchmark.actions):
            return
        kind = "discrete" if benchmark.actions.discrete else "continuous"
        others = [name for name in PLANNERS if self._can_search(name, benchmark)]
        raise ValueError(
            f"planner: {self.planner} cannot plan the {kind} actions of {benchmark.name}; set it "
            f"to {' or '.join(others)}"
        )

    @property
    def without_effect(self) -> frozenset[str]:
        """The settings of all planners but the chosen one."""
        return frozenset(field_name(name) for name in PLANNERS if name != self.planner)

    def _can_search(self, planner: str, benchmark: Benchmark) -> bool:
        return bool(getattr(self, field_name(planner)).can_search(benchmark.actions))
