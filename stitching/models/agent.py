"""A trained IQL learner at work: batched actions and ensemble values."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import torch

from stitching.envs.protocol import ActionSpace
from stitching.models.layers import Params, Precision, at_precision, mlp, named, parameters
from stitching.models.losses import LOG_STD_RANGE


@dataclass(frozen=True)
class Networks:
    """What was learned together: of all skills, or of one."""

    mean: torch.Tensor  # (observation,)
    std: torch.Tensor
    low: torch.Tensor  # (observation,) what is seen is held to this range; infinite without `clip`
    high: torch.Tensor
    policy: Params
    log_std: torch.Tensor  # (action,)
    v: Params

    @classmethod
    def of(cls, weights: Mapping[str, np.ndarray]) -> Networks:
        policy = parameters(weights, "policy")
        unbounded = np.full_like(weights["observation_mean"], np.inf)
        return cls(
            mean=torch.from_numpy(weights["observation_mean"]),
            std=torch.from_numpy(weights["observation_std"]),
            low=torch.from_numpy(weights.get("observation_low", -unbounded)),
            high=torch.from_numpy(weights.get("observation_high", unbounded)),
            log_std=policy.pop("log_std").clamp(*LOG_STD_RANGE),
            policy=policy,
            v=parameters(weights, "v"),
        )


def own_weights(weights: Mapping[str, np.ndarray], count: int) -> list[Mapping[str, np.ndarray]]:
    """The weights that serve each condition: those of `train_iql` serve them all."""
    if "observation_mean" in weights:
        return [weights] * count
    return [named(weights, str(condition)) for condition in range(count)]


class Agent:
    """Policy and value ensemble over (observation, condition); frozen, without gradients.

    Weights of `train_iql` serve all conditions, those of `train_single_tasks` one each.
    """

    def __init__(
        self, weights: dict[str, np.ndarray], conditions: np.ndarray, actions: ActionSpace
    ) -> None:
        self._conditions = torch.from_numpy(conditions)  # (C, condition)
        self._actions = actions
        self._networks = [Networks.of(own) for own in own_weights(weights, len(conditions))]

    def at_precision(self, precision: Precision) -> Agent:
        """The same agent with values computed in that precision (but for their last layer)."""
        other = copy(self)
        other._networks = [replace(one, v=at_precision(one.v, precision)) for one in self._networks]
        return other

    def _inputs(self, states: torch.Tensor, condition: int) -> torch.Tensor:
        own, conditions = self._networks[condition], self._conditions[condition]
        scaled = (states.clamp(own.low, own.high) - own.mean) / own.std
        return torch.cat([scaled, conditions.expand(len(states), -1)], dim=-1)

    def values(self, states: torch.Tensor, condition: int) -> torch.Tensor:
        """V of each member: (n, observation) → (M, n)."""
        v = self._networks[condition].v
        return mlp(v, self._inputs(states, condition)).squeeze(-1)

    def act(
        self,
        states: torch.Tensor,
        condition: int,
        noise: np.ndarray | None,
        temperature: float = 1.0,
    ) -> np.ndarray:
        """Actions (n, action) float32: the policy's mode where `noise` is None, else samples.

        Discrete policies turn noise (n, 1), uniform in [0, 1), into a sample by inverting the
        distribution function; Gaussian ones scale standard normal noise (n, action). The
        temperature of samples, above 0, divides logits or multiplies the deviation, as in IQL's
        own code.
        """
        own = self._networks[condition]
        outputs = mlp(own.policy, self._inputs(states, condition)).squeeze(0)
        if self._actions.discrete:
            return self._categorical(outputs, noise, temperature).numpy()
        mean = outputs.tanh()
        if noise is not None:
            mean = mean + temperature * torch.from_numpy(noise) * own.log_std.exp()
        return mean.clamp(-1, 1).numpy()

    def _categorical(
        self, logits: torch.Tensor, noise: np.ndarray | None, temperature: float
    ) -> torch.Tensor:
        if noise is None:
            choice = logits.argmax(dim=-1)
        else:
            below = (logits / temperature).softmax(-1).cumsum(-1) < torch.from_numpy(noise)
            # Rounding may leave the last sum just below 1.
            choice = below.sum(-1).clamp(max=self._actions.size - 1)
        return torch.nn.functional.one_hot(choice, self._actions.size).float()
