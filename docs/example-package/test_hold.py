"""What skillstitch asks of a method and of a planner."""

from __future__ import annotations

import pytest
import torch
from hold_shooting import HoldShooting
from hold_stitch import HOLD_STITCH, HoldStitchSettings

from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Models, Stitcher
from stitching.planning.protocol import Planner
from stitching.testing.planners import PlannerConformance
from stitching.testing.stitchers import StitcherConformance, streams

SPACES = {"continuous": ActionSpace(2, discrete=False), "discrete": ActionSpace(4, discrete=True)}


@pytest.fixture(params=SPACES)
def space(request: pytest.FixtureRequest) -> ActionSpace:
    return SPACES[request.param]


class TestHoldShooting(PlannerConformance):
    @pytest.fixture
    def planner(self) -> Planner:
        return HoldShooting()


class TestHoldStitch(StitcherConformance):
    @pytest.fixture
    def states(self) -> torch.Tensor:
        return torch.zeros(3, 6)

    @pytest.fixture
    def stitcher(self, space: ActionSpace) -> Stitcher:
        return HOLD_STITCH.stitcher(HoldStitchSettings(hold=3), Models(space, 4, {}))

    def test_an_action_is_held(self, stitcher: Stitcher, states: torch.Tensor) -> None:
        actions = stitcher.propose(states, 0, 1, streams(3)).actions
        assert actions.shape[1] == 3
        assert (actions == actions[:, :1]).all()
