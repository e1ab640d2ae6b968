"""What the stitchers of all methods must do, and what a method is."""

import numpy as np
import pytest
import torch

from stitching.envs.maze import Maze
from stitching.methods.protocol import Models, Stitcher
from stitching.methods.registry import METHODS
from stitching.models.agent import Agent
from tests.stitching.methods.linear import ARM, MOVES, streams

PROPOSERS = ["random-stitch", "mf-stitch", "mb-stitch", "mb-stitch[execute=1]"]
DRAWING = ["random-stitch", "mb-stitch"]  # those that leave something to chance


@pytest.fixture
def states(maze: Maze) -> torch.Tensor:
    return torch.from_numpy(maze.observations[maze.free][::4])


@pytest.mark.parametrize("method", PROPOSERS)
def test_proposals_are_actions(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    stitcher = stitchers[method]
    for n in (1, len(states)):
        actions = stitcher.propose(states[:n], 0, 1, streams(n)).actions
        steps = 4 if method == "mb-stitch" else 1
        assert actions.shape == (n, steps, MOVES.size)
        assert actions.dtype == np.float32
        assert set(np.unique(actions)) == {0, 1}
        assert (actions.sum(axis=2) == 1).all()


@pytest.mark.parametrize("method", PROPOSERS)
def test_a_proposal_belongs_to_its_stream_and_state(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    stitcher, n = stitchers[method], len(states)
    together = stitcher.propose(states, 0, 1, streams(n)).actions
    torch.manual_seed(0)
    assert np.array_equal(stitcher.propose(states, 0, 1, streams(n)).actions, together)
    for row in range(n):
        alone = stitcher.propose(states[row : row + 1], 0, 1, [streams(n)[row]]).actions
        assert np.array_equal(alone[0], together[row])


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


@pytest.mark.parametrize("name", METHODS)
def test_what_a_method_is_made_of_is_in_the_file_it_names(name: str) -> None:
    method = METHODS[name]
    assert method.module == f"stitching.methods.{name.replace('-', '_')}"
    assert method.settings() == method.settings()  # every field has a default


def test_a_model_of_another_kind_is_refused(agent: Agent) -> None:
    models = Models(ARM, 2, {"agent": agent, "dynamics": agent})
    assert models.agent is agent
    with pytest.raises(TypeError, match="dynamics: expected str, got Agent"):
        models.one("dynamics", str)
