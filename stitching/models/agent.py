"""A trained IQL learner at work: batched actions and ensemble values."""

from __future__ import annotations

from copy import copy

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.iql import LOG_STD_RANGE
from stitching.models.layers import Precision, at_precision, mlp, parameters


class Agent:
    """Policy and value ensemble over (observation, condition); frozen, without gradients."""

    def __init__(
        self, weights: dict[str, np.ndarray], conditions: np.ndarray, actions: ActionSpace
    ) -> None:
        self._mean = torch.from_numpy(weights["observation_mean"])
        self._std = torch.from_numpy(weights["observation_std"])
        self._conditions = torch.from_numpy(conditions)  # (C, condition)
        self._policy = parameters(weights, "policy")
        self._log_std = self._policy.pop("log_std").clamp(*LOG_STD_RANGE)
        self._v = parameters(weights, "v")
        self._actions = actions

    def at_precision(self, precision: Precision) -> Agent:
        """The same agent with values computed in that precision (but for their last layer)."""
        other = copy(self)
        other._v = at_precision(self._v, precision)
        return other

    def _inputs(self, states: Tensor, condition: int) -> Tensor:
        conditions = self._conditions[condition].expand(len(states), -1)
        return torch.cat([(states - self._mean) / self._std, conditions], dim=-1)

    def values(self, states: Tensor, condition: int) -> Tensor:
        """V of each member: (n, observation) → (M, n)."""
        return mlp(self._v, self._inputs(states, condition)).squeeze(-1)

    def act(self, states: Tensor, condition: int, noise: np.ndarray | None) -> np.ndarray:
        """Actions (n, action) float32: the policy's mode where `noise` is None, else samples.

        Discrete policies turn noise (n, 1), uniform in [0, 1), into a sample by inverting the
        distribution function; Gaussian ones scale standard normal noise (n, action).
        """
        outputs = mlp(self._policy, self._inputs(states, condition)).squeeze(0)
        if self._actions.discrete:
            return self._categorical(outputs, noise).numpy()
        mean = outputs.tanh()
        if noise is not None:
            mean = mean + torch.from_numpy(noise) * self._log_std.exp()
        return mean.clamp(-1, 1).numpy()

    def _categorical(self, logits: Tensor, noise: np.ndarray | None) -> Tensor:
        if noise is None:
            choice = logits.argmax(dim=-1)
        else:
            below = logits.softmax(-1).cumsum(-1) < torch.from_numpy(noise)
            # Rounding may leave the last sum just below 1.
            choice = below.sum(-1).clamp(max=self._actions.size - 1)
        return torch.nn.functional.one_hot(choice, self._actions.size).float()
