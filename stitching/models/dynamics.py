"""The dynamics ensemble T_φ(s'|s, a), trained on the union of all data (paper 3.1, B.1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from stitching.bounds import Amount, Bounded, Count, Few, LearningRate, Width
from stitching.data.transitions import Transitions
from stitching.models.layers import (
    Activation,
    Precision,
    at_precision,
    init_mlp,
    mlp,
    parameters,
    prefixed,
)
from stitching.models.scale import observation_scale
from stitching.models.training import CurveLog, Trained, Training, cosine
from stitching.streams import stream


@dataclass(frozen=True)
class DynamicsConfig(Bounded):
    """The paper gives "two or three layers" and the activation; the rest is ours."""

    updates: Amount = 3_000  # 0: untrained
    batch_size: Count = 256
    learning_rate: LearningRate = 1e-3
    learning_rate_decay: bool = True  # cosine to 0
    members: Few = 5
    width: Width = 128
    hidden_layers: Few = 2
    activation: Activation = "relu"  # relu in the maze, elu in Kitchen, sigmoid in Robosuite
    precision: Precision = "float32"  # of the hidden layers, while training and predicting
    log_every: Count = 250


class Dynamics:
    """A trained ensemble, ready to predict. Each member rolls out its own imagined states."""

    def __init__(self, weights: dict[str, np.ndarray], config: DynamicsConfig) -> None:
        self._mean = torch.from_numpy(weights["observation_mean"])
        self._std = torch.from_numpy(weights["observation_std"])
        self._params = at_precision(parameters(weights, "t"), config.precision, output=True)
        self._activation = config.activation
        self.precision = config.precision

    def scaled(self, states: torch.Tensor) -> torch.Tensor:
        """States in units of the data's standard deviation, per dimension."""
        return states / self._std

    def __call__(self, states: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """Next states: (D or 1, n, observation), (n, action) → (D, n, observation)."""
        return states + self._change((states - self._mean) / self._std, actions) * self._std

    def imagine(self, states: torch.Tensor, sequences: torch.Tensor) -> torch.Tensor:
        """States after whole sequences: (n, observation), (n, horizon, action) → (D, n, …).

        The same as one step after another, but normalised once.
        """
        *_, last = self._scaled_steps(states, sequences)
        return last * self._std + self._mean

    def imagine_path(self, states: torch.Tensor, sequences: torch.Tensor) -> torch.Tensor:
        """States after each step: (n, observation), (n, horizon, action) → (D, horizon, n, …)."""
        steps = torch.stack(list(self._scaled_steps(states, sequences)), dim=1)
        return steps * self._std + self._mean

    def _scaled_steps(
        self, states: torch.Tensor, sequences: torch.Tensor
    ) -> Iterator[torch.Tensor]:
        """The members' states after each step, in units of their scale: (D, n, observation)."""
        scaled = ((states - self._mean) / self._std).unsqueeze(0)
        for actions in sequences.unbind(dim=1):
            scaled = scaled + self._change(scaled, actions)
            yield scaled

    def _change(self, scaled: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """Change of state in units of its scale: (D or 1, n, observation) → (D, n, observation)."""
        inputs = torch.cat([scaled, actions.expand(len(scaled), -1, -1)], dim=-1)
        members = self._params["w0"].shape[0]
        return mlp(self._params, inputs.expand(members, -1, -1), self._activation)


def train_dynamics(data: Transitions, config: DynamicsConfig, *labels: str | int) -> Trained:
    """Minimise the squared error of the next state, per dimension in units of the data's scale.

    The networks output the change of state, which is the same loss with an easier target. Members
    differ by initial weights and by their own stream of minibatches.
    """
    mean, std = observation_scale(data.observations)
    states = torch.from_numpy((np.asarray(data.observations) - mean) / std)
    actions = torch.from_numpy(np.array(data.actions))
    inputs = torch.cat([states, actions], dim=-1)
    targets = torch.from_numpy((np.asarray(data.next_observations) - mean) / std) - states

    sizes = [inputs.shape[1], *[config.width] * config.hidden_layers, states.shape[1]]
    params = init_mlp(config.members, sizes, stream("init", *labels))
    for parameter in params.values():
        parameter.requires_grad_()
    optimizer = torch.optim.Adam(params.values(), lr=config.learning_rate, fused=True)
    batches = stream("batches", *labels)
    log = CurveLog(config.updates, config.log_every)
    training = Training(labels, params, optimizer, batches, log)
    for update in training.updates():
        if config.learning_rate_decay:
            rate = config.learning_rate * cosine(update, config.updates)
            optimizer.param_groups[0]["lr"] = rate
        index = torch.from_numpy(
            batches.integers(len(data), size=(config.members, config.batch_size))
        )
        layers = at_precision(params, config.precision)
        predicted = mlp(layers, inputs[index], config.activation)
        loss = (predicted - targets[index]).square().mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        log.record(update, {"prediction_loss": loss})
    weights = {"observation_mean": mean, "observation_std": std, **prefixed(params, "t")}
    return Trained(weights, log.curves)
