"""The planners by name, and what settings of methods that plan have in common."""

from __future__ import annotations

from dataclasses import dataclass, is_dataclass
from typing import TYPE_CHECKING, Any

from stitching.bounds import Bounded
from stitching.planning.cem import CEM
from stitching.planning.protocol import Planner
from stitching.planning.random_shooting import RandomShooting
from stitching.registry import field_name, sections, with_installed

PLANNERS: dict[str, type[Planner]] = with_installed(
    "skillstitch.planners",
    {"random-shooting": RandomShooting, "cem": CEM},
    lambda part: is_dataclass(part) and hasattr(part, "plan") and hasattr(part, "can_search"),
)

if TYPE_CHECKING:

    class PlannerSections(Bounded):
        """A field for the settings of each planner: `cem`, `random_shooting`."""

        def __getattr__(self, name: str) -> Any: ...

else:
    PlannerSections = sections("PlannerSections", PLANNERS)


@dataclass(frozen=True)
class PlannerChoice(PlannerSections):
    """Settings of every planner, and which one plans."""

    planner: str = "cem"  # random-shooting, cem, or one that another package brings

    def __post_init__(self) -> None:
        if self.planner not in PLANNERS:
            raise ValueError(f"planner: {self.planner!r} is not one of {', '.join(PLANNERS)}")
        super().__post_init__()

    @property
    def chosen(self) -> Planner:
        """The planner itself: it is its settings."""
        planner: Planner = getattr(self, field_name(self.planner))
        return planner
