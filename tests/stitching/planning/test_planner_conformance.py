"""Every registered planner does what a planner must, on all actions that it can search."""

import pytest

from stitching.envs.protocol import ActionSpace
from stitching.planning.protocol import Planner
from stitching.planning.registry import PLANNERS
from stitching.testing.planners import PlannerConformance

SPACES = {"continuous": ActionSpace(2, discrete=False), "discrete": ActionSpace(2, discrete=True)}
CASES = [
    pytest.param((planner(), space), id=f"{name}, {kind}")
    for name, planner in PLANNERS.items()
    for kind, space in SPACES.items()
    if planner().can_search(space)
]


class TestPlanners(PlannerConformance):
    @pytest.fixture(params=CASES)
    def case(self, request: pytest.FixtureRequest) -> tuple[Planner, ActionSpace]:
        return request.param

    @pytest.fixture
    def planner(self, case: tuple[Planner, ActionSpace]) -> Planner:
        return case[0]

    @pytest.fixture
    def space(self, case: tuple[Planner, ActionSpace]) -> ActionSpace:
        return case[1]
