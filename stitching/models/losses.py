"""The three losses of implicit Q-learning (Kostrikov et al., 2022, Eqs. 5 to 7)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch

from stitching.models.layers import Params, at_precision, mlp

if TYPE_CHECKING:
    from stitching.models.iql import IQLConfig

LOG_STD_RANGE = (-5.0, 2.0)
MAX_ADVANTAGE_WEIGHT = 100.0  # as in the authors' implementation


@dataclass(frozen=True)
class Batch:
    """One minibatch of B transitions; inputs are normalised observations next to conditions."""

    inputs: torch.Tensor  # (B, observation + condition)
    actions: torch.Tensor  # (B, action)
    next_inputs: torch.Tensor  # (B, observation + condition)
    rewards: torch.Tensor  # (B,)
    continues: torch.Tensor  # (B,) 0 where terminal, else 1


def expectile_loss(difference: torch.Tensor, expectile: float) -> torch.Tensor:
    """Eq. 5 of IQL: the asymmetric square |expectile − 1(u < 0)| u², elementwise."""
    return torch.where(difference < 0, 1 - expectile, expectile) * difference.square()


def twin_minimum(q: torch.Tensor) -> torch.Tensor:
    """The smaller of each member's two Q-functions: (2M, B, 1) → (M, B)."""
    return q.squeeze(-1).unflatten(0, (-1, 2)).amin(dim=1)


def log_probability(
    outputs: torch.Tensor, log_std: torch.Tensor, actions: torch.Tensor, discrete: bool
) -> torch.Tensor:
    """log π(a|s): categorical over one-hot actions, or Gaussian around tanh(outputs). (B,)"""
    if discrete:
        return (outputs.log_softmax(-1) * actions).sum(-1)
    log_std = log_std.clamp(*LOG_STD_RANGE)
    scaled = (actions - outputs.tanh()) * torch.exp(-log_std)
    return (-0.5 * scaled.square() - log_std - 0.5 * math.log(2 * math.pi)).sum(-1)


def value_loss(target_q: torch.Tensor, v: torch.Tensor, expectile: float) -> torch.Tensor:
    """Eq. 5: V(s) towards an upper expectile of the target networks' Q(s, a); both (M, B)."""
    return expectile_loss(target_q - v, expectile).mean()


def q_loss(q: torch.Tensor, backup: torch.Tensor) -> torch.Tensor:
    """Eq. 6: Q(s, a) towards r + γ V(s'); (M, 2, B) and (M, B)."""
    return (q - backup.unsqueeze(1)).square().mean()


def policy_loss(
    advantage: torch.Tensor, log_prob: torch.Tensor, temperature: float
) -> torch.Tensor:
    """Eq. 7: imitation, weighted by exp(β A(s, a)); both (B,)."""
    weight = (temperature * advantage).exp().clamp(max=MAX_ADVANTAGE_WEIGHT)
    return -(weight * log_prob).mean()


def iql_losses(
    q: Params,
    q_target: Params,
    v: Params,
    policy: Params,
    log_std: torch.Tensor,
    batch: Batch,
    config: IQLConfig,
    discrete: bool,
    generator: torch.Generator,
) -> dict[str, torch.Tensor]:
    """All three, each averaged over batch and members, and what is watched beside them.

    q_target are the slow copies of q. The policy is extracted with the members' mean advantage.
    """
    q, q_target, v, policy = (
        at_precision(params, config.precision) for params in (q, q_target, v, policy)
    )
    state_actions = torch.cat([batch.inputs, batch.actions], dim=-1)
    with torch.no_grad():
        target_q = twin_minimum(mlp(q_target, state_actions))  # (M, B)
        next_v = mlp(v, batch.next_inputs).squeeze(-1)  # (M, B)
        backup = batch.rewards + config.gamma * batch.continues * next_v

    now_v = mlp(v, batch.inputs).squeeze(-1)  # (M, B)
    now_q = mlp(q, state_actions).squeeze(-1).unflatten(0, (-1, 2))  # (M, 2, B)
    advantage = (target_q - now_v.detach()).mean(dim=0)  # (B,)
    outputs = mlp(policy, batch.inputs, dropout=config.dropout, generator=generator).squeeze(0)
    log_prob = log_probability(outputs, log_std, batch.actions, discrete)
    return {
        "value_loss": value_loss(target_q, now_v, config.expectile),
        "q_loss": q_loss(now_q, backup),
        "policy_loss": policy_loss(advantage, log_prob, config.temperature),
        "mean_value": now_v.detach().mean(),
        "value_disagreement": now_v.detach().std(dim=0, correction=0).mean(),
    }
