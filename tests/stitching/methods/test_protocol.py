"""What the stitchers of all methods must do, and what a method is."""

import numpy as np
import pytest
import torch

from stitching.envs.maze import Maze
from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Models, Stitcher
from stitching.methods.registry import METHODS
from stitching.models.agent import Agent
from stitching.testing.stitchers import StitcherConformance
from tests.stitching.methods.linear import ARM, streams

DRAWING = ["random-stitch", "mb-stitch"]  # those that leave something to chance


@pytest.fixture
def states(maze: Maze) -> torch.Tensor:
    return torch.from_numpy(maze.observations[maze.free][::4])


class TestStitchers(StitcherConformance):
    @pytest.fixture(
        params=["random-stitch", "mf-stitch", "mb-stitch", "mb-stitch[execute=1]", "reach-stitch"]
    )
    def stitcher(self, request: pytest.FixtureRequest, stitchers: dict[str, Stitcher]) -> Stitcher:
        return stitchers[request.param]

    @pytest.fixture
    def space(self, maze: Maze) -> ActionSpace:
        return maze.actions


def test_as_many_actions_are_proposed_as_are_to_be_executed(
    stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    steps = {"random-stitch": 1, "mf-stitch": 1, "mb-stitch": 4, "mb-stitch[execute=1]": 1}
    for method, expected in steps.items():
        proposal = stitchers[method].propose(states, 0, 1, streams(len(states)))
        assert proposal.actions.shape[1] == expected


@pytest.mark.parametrize("method", DRAWING)
def test_other_streams_bring_other_proposals(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    same = states[:1].expand(40, -1)
    proposals = stitchers[method].propose(same, 0, 1, streams(40)).actions
    assert len(np.unique(proposals, axis=0)) > 1


@pytest.mark.parametrize("method", DRAWING)
def test_streams_go_on_from_call_to_call(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    same, generators = states[:1].expand(40, -1), streams(40)
    first, second = (stitchers[method].propose(same, 0, 1, generators).actions for _ in range(2))
    assert not np.array_equal(first, second)


OURS = [name for name, one in METHODS.items() if one.settings.__module__.startswith("stitching.")]


@pytest.mark.parametrize("name", OURS)
def test_a_method_is_one_file_called_as_it_is(name: str) -> None:
    """Single-Policy has no stitcher of its own."""
    file = f"stitching.methods.{name.replace('-', '_')}"
    others = {"stitching.methods.no_stitch"} if name == "single-policy" else set()
    assert METHODS[name].modules == {file} | others


def test_a_model_of_another_kind_is_refused(agent: Agent) -> None:
    models = Models(ARM, 2, {"agent": agent, "dynamics": agent})
    assert models.agent is agent
    with pytest.raises(TypeError, match="dynamics: expected str, got Agent"):
        models.one("dynamics", str)
