"""What every planner and every stitcher must do, as tests to inherit from; they need pytest.

class TestMyPlanner(PlannerConformance):
    @pytest.fixture
    def planner(self) -> Planner:
        return MyPlanner()

    @pytest.fixture
    def space(self) -> ActionSpace:
        return ActionSpace(2, discrete=False)
"""

import pytest

pytest.register_assert_rewrite("stitching.testing.planners", "stitching.testing.stitchers")
