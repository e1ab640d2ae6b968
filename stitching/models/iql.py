"""Implicit Q-learning (Kostrikov et al., 2022) with an ensemble of value functions, one policy.

Table 6 gives the hyperparameters. A member of the ensemble is a pair of Q-functions with their
slow targets and a value function V; all members learn in one stacked pass from the same batches
and differ by their initial weights. The policy is extracted with the members' mean advantage.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from stitching.bounds import (
    Amount,
    Bounded,
    Count,
    Few,
    FewOrNone,
    Inside,
    LearningRate,
    NotNegative,
    Share,
    ShareAboveZero,
    ShareBelowOne,
    Times,
    Width,
    WidthOrNone,
)
from stitching.data.corrections import Corrections
from stitching.data.experience import Experience
from stitching.data.swapping import Swapping
from stitching.envs.protocol import ActionSpace
from stitching.models.layers import (
    Params,
    Precision,
    init_mlp,
    prefixed,
    prefixed_tensors,
)
from stitching.models.losses import Batch, iql_losses
from stitching.models.scale import observation_range, observation_scale
from stitching.models.training import (
    DRAWN_AT_ONCE,
    CurveLog,
    Curves,
    Trained,
    Training,
    cosine,
)
from stitching.streams import stream


@dataclass(frozen=True)
class IQLConfig(Bounded):
    """Table 6; widths, members and updates are ours, the paper gives none."""

    updates: Amount = 10_000  # 0: untrained
    batch_size: Count = 256
    learning_rate: LearningRate = 3e-4
    learning_rate_decay: bool = True  # cosine to 0, policy only, as in the authors' implementation
    dropout: ShareBelowOne = 0.1  # policy only, likewise
    gamma: ShareAboveZero = 0.99
    tau: ShareAboveZero = 0.005
    expectile: Inside = 0.7
    temperature: NotNegative = 0.5
    members: Few = 5
    width: Width = 64  # of the critics' hidden layers
    hidden_layers: Few = 2
    policy_width: WidthOrNone = 0  # of the policy's; 0: as the critics
    policy_layers: FewOrNone = 0
    precision: Precision = "float32"  # of the hidden layers while training
    multi_task: bool = True  # one set of networks for all skills (Maze, Kitchen), or one a skill
    swap: Share = 0.0  # share of the transitions in which objects that play no part are swapped
    corrections: Times = 0.0  # steps by which the robot is displaced in half of the others
    clip: bool = False  # what is seen is held to the range that the data have, number by number
    log_every: Count = 500

    @property
    def alters(self) -> bool:
        """Whether what is learned from is not only what the data hold."""
        return bool(self.swap or self.corrections)

    @property
    def policy_hidden(self) -> list[int]:
        """Widths of the policy's hidden layers."""
        return [self.policy_width or self.width] * (self.policy_layers or self.hidden_layers)


def train_iql(
    experience: Experience,
    actions: ActionSpace,
    config: IQLConfig,
    *labels: str | int,
    policy_from: Params | None = None,
    swapping: Swapping | None = None,
    corrections: Corrections | None = None,
) -> Trained:
    """Learn value ensemble and policy; all randomness comes from streams named by `labels`.

    With `clip` the range of the data is kept beside the weights: all that is learned from lies in
    it, so only what is asked later can be held to it.

    `policy_from`, of the same shape and with its "log_std", is where the policy starts; the values
    are learned anew. `swapping` and `corrections` alter the minibatches. Raises FloatingPointError
    when a loss stops being finite.
    """
    data = experience.data
    mean, std = observation_scale(data.observations)
    state = data.observations.shape[1] + experience.conditions.shape[1]
    hidden = [config.width] * config.hidden_layers
    init = stream("init", *labels)
    q = init_mlp(2 * config.members, [state + actions.size, *hidden, 1], init)
    v = init_mlp(config.members, [state, *hidden, 1], init)
    policy = init_mlp(1, [state, *config.policy_hidden, actions.size], init)
    policy["log_std"] = torch.zeros(actions.size)
    if policy_from is not None:
        policy = {name: policy_from[name].clone() for name in policy}
    log_std = policy.pop("log_std")
    q_target = {name: weight.clone() for name, weight in q.items()}

    critic = [*q.values(), *v.values()]
    actor = [*policy.values(), log_std]
    for parameter in (*critic, *actor):
        parameter.requires_grad_()
    optimizer = torch.optim.Adam(
        [{"params": critic}, {"params": actor}], lr=config.learning_rate, fused=True
    )
    generator = torch.Generator().manual_seed(int(stream("dropout", *labels).integers(2**63)))

    log = CurveLog(config.updates, config.log_every)
    rng = stream("batches", *labels)
    batches = minibatches(experience, mean, std, config.batch_size, rng, swapping, corrections)
    networks = {"q": q, "v": v, "policy": policy | {"log_std": log_std}}
    changing = prefixed_tensors(q_target=q_target, **networks)
    training = Training(labels, changing, optimizer, rng, log, dropout=generator)
    for update in training.updates():
        if config.learning_rate_decay:
            rate = config.learning_rate * cosine(update, config.updates)
            optimizer.param_groups[1]["lr"] = rate
        losses = iql_losses(
            q, q_target, v, policy, log_std, next(batches), config, actions.discrete, generator
        )
        optimizer.zero_grad(set_to_none=True)
        # The three losses share no parameters, so one backward pass serves them all.
        (losses["value_loss"] + losses["q_loss"] + losses["policy_loss"]).backward()
        optimizer.step()
        torch._foreach_lerp_(list(q_target.values()), [w.detach() for w in q.values()], config.tau)
        log.record(update, losses)

    weights = {"observation_mean": mean, "observation_std": std}
    if config.clip:
        low, high = observation_range(data.observations, data.next_observations)
        if corrections is not None:
            low, high = corrections.widened(low, high)
        weights |= {"observation_low": low, "observation_high": high}
    for name, params in networks.items():
        weights |= prefixed(params, name)
    return Trained(weights, log.curves)


def train_single_tasks(
    experience: Experience,
    actions: ActionSpace,
    config: IQLConfig,
    *labels: str | int,
    policies_from: Sequence[Params] | None = None,
) -> Trained:
    """Learn each condition with networks of its own: a skill's (Robosuite) or a pair's.

    Weights are named "condition.network". `policies_from`: where each condition's policy starts.
    """
    weights: dict[str, np.ndarray] = {}
    curves: Curves = {}
    for condition in range(len(experience.conditions)):
        policy_from = policies_from[condition] if policies_from else None
        own = experience.of(condition)
        one = train_iql(own, actions, config, *labels, condition, policy_from=policy_from)
        weights |= {f"{condition}.{name}": array for name, array in one.weights.items()}
        curves |= {f"{name} of skill {condition}": curve for name, curve in one.curves.items()}
    return Trained(weights, curves)


def minibatches(
    experience: Experience,
    mean: np.ndarray,
    std: np.ndarray,
    batch_size: int,
    rng: np.random.Generator,
    swapping: Swapping | None = None,
    corrections: Corrections | None = None,
) -> Iterator[Batch]:
    """Endless uniform minibatches, drawn with replacement.

    `swapping` alters s and s' alike, `corrections` alter s, a and s'.
    """
    data = experience.data
    observations = torch.from_numpy((np.asarray(data.observations) - mean) / std)
    next_observations = torch.from_numpy((np.asarray(data.next_observations) - mean) / std)
    actions = torch.from_numpy(np.array(data.actions))
    rows = torch.from_numpy(experience.rows)
    condition_ids = torch.from_numpy(experience.condition_ids)
    conditions = torch.from_numpy(experience.conditions)
    rewards = torch.from_numpy(experience.rewards)
    continues = torch.from_numpy((~experience.terminals).astype(np.float32))
    columns = torch.arange(observations.shape[1])
    while True:
        for index in torch.from_numpy(rng.integers(len(rows), size=(DRAWN_AT_ONCE, batch_size))):
            row, condition = rows[index], conditions[condition_ids[index]]
            now, following, action = observations[row], next_observations[row], actions[row]
            if swapping is not None:
                swapped, donors, after = map(torch.from_numpy, swapping.draw(row.numpy(), rng))
                other = torch.where(
                    after, next_observations[donors, columns], observations[donors, columns]
                )
                now, following = (torch.where(swapped, other, own) for own in (now, following))
            if corrections is not None:
                displaced = corrections.draw(row.numpy(), action.numpy(), rng)
                now = now + torch.from_numpy(displaced.now / std)
                following = following + torch.from_numpy(displaced.following / std)
                action = action + torch.from_numpy(displaced.actions)
            yield Batch(
                inputs=torch.cat([now, condition], dim=-1),
                actions=action,
                next_inputs=torch.cat([following, condition], dim=-1),
                rewards=rewards[index],
                continues=continues[index],
            )
