"""What every benchmark, planner and stitcher must do, as tests to inherit from; they need pytest.

class TestMyPlanner(PlannerConformance):
    @pytest.fixture
    def planner(self) -> Planner:
        return MyPlanner()

    @pytest.fixture
    def space(self) -> ActionSpace:
        return ActionSpace(2, discrete=False)
"""

import pytest

for part in ("benchmarks", "planners", "stitchers"):
    pytest.register_assert_rewrite(f"stitching.testing.{part}")
