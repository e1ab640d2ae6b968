"""The planners by name, and what settings of methods that plan have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from stitching.bounds import Bounded
from stitching.planning.cem import CEM
from stitching.planning.protocol import Planner
from stitching.planning.random_shooting import RandomShooting
from stitching.registry import (
    PartError,
    field_name,
    lacking,
    sections,
    with_installed,
    wrong_settings,
)


def _wrong(part: Any) -> str:
    """What keeps a part from being a planner, in words; empty where nothing does."""
    if wrong := wrong_settings(part, Bounded):
        return wrong
    missing = lacking(part(), ("plan", "can_search", "horizon", "samples"))
    return f"has no {missing!r}" if missing else ""


PLANNERS: dict[str, type[Planner]] = with_installed(
    "skillstitch.planners", {"random-shooting": RandomShooting, "cem": CEM}, _wrong
)

if TYPE_CHECKING:
    PlannerName = str

    class PlannerSections(Bounded):
        """A field for the settings of each planner: `cem`, `random_shooting`."""

else:
    PlannerName = Literal[tuple(PLANNERS)]
    PlannerSections = sections("PlannerSections", PLANNERS)


@dataclass(frozen=True)
class PlannerChoice(PlannerSections):
    """Settings of every planner, and which one plans."""

    planner: PlannerName = "cem"

    def __init_subclass__(cls) -> None:
        """Raise PartError where a setting of a method has the name of a planner."""
        super().__init_subclass__()
        for name, planner in PLANNERS.items():
            own = vars(cls).get(field_name(name))
            if own is not None and not isinstance(own, planner):
                raise PartError(f"planner {name!r}: {cls.__name__} has another setting so called")

    @property
    def chosen(self) -> Planner:
        """The planner itself: it is its settings."""
        planner: Planner = getattr(self, field_name(self.planner))
        return planner
