"""What playing a plan's blocks is expected to take and to come to."""

from __future__ import annotations

from dataclasses import dataclass, field

from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.costs.effort import planning_seconds
from orchestrator.costs.likeness import Likeness
from orchestrator.spec.methods import method_of
from orchestrator.storage.ledger import PlayCounts
from orchestrator.work.plan import Node, Plan
from orchestrator.work.recipes import digest


@dataclass
class Expectations:
    """As blocks like a block went before; where none did, counted from the settings."""

    plan: Plan
    history: dict[str, PlayCounts]  # see `Ledger.history`
    _kinds: dict[tuple[str, int, int, int], str] = field(default_factory=dict)
    _seconds: dict[str, float] = field(default_factory=dict)  # by method

    def __post_init__(self) -> None:
        self._likeness = Likeness(self.plan.recipes)

    def kind(self, node: Node, chunk: int) -> str:
        """What segments like a block's are called where it is remembered how they went.

        They are alike in all that names a block but its seeds, which skills it plays and which
        episodes: in the benchmark, the method and its settings, the models and the data that these
        were learned from, how many skills come before, and how many episodes step together.
        """
        first, end = self.plan.chunks[chunk]
        place = node.method, node.seed, len(node.prefix), end - first
        if place not in self._kinds:
            self._kinds[place] = self._kind(*place)
        return self._kinds[place]

    def _kind(self, method: str, seed: int, skill: int, episodes: int) -> str:
        spec, blocks = self.plan.spec, self.plan.method_blocks[method]
        models = {
            kind: self._likeness.of(self.plan.models[kind, seed, method]) for kind in blocks.models
        }
        alike = {name: value for name, value in blocks.named.items() if name != "code"}
        alike |= {"models": models, "episodes": episodes, "step_limit": spec.step_limit}
        label = f"{spec.benchmark}, {blocks.name or 'any method'}, skill {skill}"
        return f"{label}, {digest(alike)}"

    def measured(self, node: Node, chunk: int) -> bool:
        """Whether blocks like this one were played before."""
        return self.kind(node, chunk) in self.history

    def success_rate(self, node: Node, chunk: int) -> float:
        known = self.history.get(self.kind(node, chunk))
        return (
            ENTRIES[self.plan.spec.benchmark].costs.success if known is None else known.success_rate
        )

    def seconds_each(self, node: Node, chunk: int) -> float:
        """What a segment of a block is expected to take a worker."""
        known = self.history.get(self.kind(node, chunk))
        return self._counted(node.method) if known is None else known.seconds_each

    def _counted(self, method: str) -> float:
        if method not in self._seconds:
            spec = self.plan.spec
            planning = planning_seconds(
                spec,
                self.plan.method_blocks[method].settings,
                until_value_falls=method_of(method).stitcher.until_value_falls,
            )
            self._seconds[method] = ENTRIES[spec.benchmark].costs.segment + planning
        return self._seconds[method]

    def remember(self, kind: str, played: PlayCounts) -> None:
        """How more blocks went."""
        known = self.history.get(kind)
        self.history[kind] = played if known is None else known + played
