"""Imagined scores: every sequence judged from its own problem's state, repeated ones but once."""

import numpy as np
import pytest
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.planning.imagining import distinct, imagined
from stitching.streams import stream

MOVES, ARM = ActionSpace(4, discrete=True), ActionSpace(2, discrete=False)
PROBLEMS, POPULATION, HORIZON = 3, 50, 2


@pytest.mark.parametrize("actions", [MOVES, ARM], ids=["discrete", "continuous"])
def test_sequences_are_judged_from_their_own_problems_state(actions: ActionSpace) -> None:
    states = torch.tensor([[0.0], [1.0], [2.0], [3.0]])
    drawn = actions.uniform(stream("imagined"), (PROBLEMS, POPULATION, HORIZON))
    sampled, weights = torch.from_numpy(drawn), torch.arange(1.0, actions.size + 1)
    judged: list[int] = []

    def judge(starts: Tensor, sequences: Tensor) -> Tensor:
        judged.append(len(starts))
        return 100 * starts[:, 0] + (sequences * weights).sum(dim=(1, 2))

    problems = torch.tensor([3, 0, 2])
    scores = imagined(states, actions, judge)(problems, sampled)
    expected = 100 * states[problems] + (sampled * weights).sum(dim=(2, 3))
    assert scores.shape == (PROBLEMS, POPULATION)
    assert torch.allclose(scores, expected)
    every = PROBLEMS * POPULATION
    assert judged == [every] if not actions.discrete else judged[0] <= PROBLEMS * 4**HORIZON < every


@pytest.mark.parametrize("copies", [1, 3])
def test_distinct_pairs_are_found_again(copies: int) -> None:
    rng = stream("distinct")
    starts = torch.from_numpy(np.repeat(rng.integers(2, size=(30, 3)), copies, axis=0)).float()
    sequences = torch.from_numpy(np.repeat(MOVES.uniform(rng, (30, 2)), copies, axis=0))
    own_starts, own_sequences, inverse = distinct(starts, sequences)
    assert torch.equal(own_starts[inverse], starts)
    assert torch.equal(own_sequences[inverse], sequences)
    pairs = torch.cat([starts, sequences.flatten(1)], dim=1).tolist()
    assert len(own_starts) == len(own_sequences) == len({tuple(pair) for pair in pairs})
