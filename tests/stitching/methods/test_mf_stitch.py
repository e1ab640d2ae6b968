"""MF-Stitch plays the mode of its policy, asked about the pair."""

from itertools import permutations

import numpy as np
import torch

from stitching.data.mixtures import skill_pairs
from stitching.methods.mf_stitch import MFStitch, MFStitchSettings
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from tests.stitching.methods.linear import MOVES, linear_agent, streams


def stitcher(policy: Agent, skills: int) -> MFStitch:
    return MFStitch(MFStitchSettings(limit=5), Models(MOVES, skills, {"mf-policy": policy}))


def test_mf_stitch_asks_its_policy_about_the_ordered_pair() -> None:
    """This policy heads for the following skill and shuns the previous one."""
    one_hot = np.eye(4, dtype=np.float32)
    conditions = np.array([[*one_hot[i], *one_hot[j]] for i, j in skill_pairs(4)])
    towards = np.concatenate([np.zeros((6, 4)), -50 * np.eye(4), 50 * np.eye(4)])
    policy = linear_agent(np.zeros((1, 14)), towards, conditions, MOVES)
    for previous, following in permutations(range(4), 2):
        proposal = stitcher(policy, 4).propose(torch.zeros(10, 6), previous, following, streams(10))
        assert (proposal.actions.argmax(axis=2) == following).all()


def test_mf_stitch_plays_its_policys_mode() -> None:
    likes = np.log([0.1, 0.2, 0.4, 0.3])
    policy = linear_agent(np.zeros((1, 2)), np.stack([0 * likes, likes]), np.ones((2, 1)), MOVES)
    actions = stitcher(policy, 2).propose(torch.zeros(50, 1), 0, 1, streams(50)).actions
    assert (actions.argmax(axis=2) == 2).all()
