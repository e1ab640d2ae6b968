"""Small linear models whose right answer can be told."""

import numpy as np

from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.streams import stream

MOVES, ARM = ActionSpace(4, discrete=True), ActionSpace(2, discrete=False)


def streams(n: int, use: str = "stitch") -> list[np.random.Generator]:
    return [stream(use, i) for i in range(n)]


def linear_agent(
    v: np.ndarray, policy: np.ndarray, conditions: np.ndarray, actions: ActionSpace
) -> Agent:
    """V and policy as linear maps: v (members, in), policy (in, action); in = state + condition."""
    states = policy.shape[0] - conditions.shape[1]
    weights = {
        "observation_mean": np.zeros(states),
        "observation_std": np.ones(states),
        "v.w0": v[..., None],
        "v.b0": np.zeros((len(v), 1, 1)),
        "policy.w0": policy[None],
        "policy.b0": np.zeros((1, 1, actions.size)),
        "policy.log_std": np.zeros(actions.size),
    }
    weights = {name: array.astype(np.float32) for name, array in weights.items()}
    return Agent(weights, conditions.astype(np.float32), actions)
