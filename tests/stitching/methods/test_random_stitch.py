"""Random-Stitch draws uniformly, from every kind of action."""

import numpy as np
import torch

from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Models
from stitching.methods.random_stitch import RandomStitch, RandomStitchSettings
from tests.stitching.methods.linear import ARM, MOVES, streams


def stitcher(actions: ActionSpace) -> RandomStitch:
    return RandomStitch(RandomStitchSettings(limit=5), Models(actions, 4, {}))


def test_random_stitch_is_uniform_whatever_the_state() -> None:
    random = stitcher(MOVES)
    actions = random.propose(torch.zeros(4000, 6), 0, 1, streams(4000)).actions
    np.testing.assert_allclose(actions.mean(axis=(0, 1)), 0.25, atol=0.03)
    elsewhere = random.propose(torch.ones(4000, 6), 2, 3, streams(4000)).actions
    assert np.array_equal(elsewhere, actions)


def test_random_stitch_fills_the_box() -> None:
    actions = stitcher(ARM).propose(torch.zeros(2000, 6), 0, 1, streams(2000)).actions
    assert actions.shape == (2000, 1, 2)
    assert np.abs(actions).max() <= 1
    np.testing.assert_allclose(
        np.quantile(actions[:, 0], [0.25, 0.5, 0.75], axis=0), [[-0.5] * 2, [0.0] * 2, [0.5] * 2],
        atol=0.08,
    )  # fmt: skip
