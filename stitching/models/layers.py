"""Ensembles of multi-layer perceptrons: stacked weights, one `baddbmm` a layer for all members."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
import torch

Params: TypeAlias = "dict[str, torch.Tensor]"
Precision = Literal["float32", "bfloat16"]
Activation = Literal["relu", "elu", "sigmoid"]

ACTIVATIONS: dict[Activation, Callable[[torch.Tensor], torch.Tensor]] = {
    "relu": lambda x: torch.relu(x),
    "elu": lambda x: torch.nn.functional.elu(x),
    "sigmoid": lambda x: torch.sigmoid(x),
}


def init_mlp(members: int, sizes: Sequence[int], rng: np.random.Generator) -> Params:
    """Weights `w0, b0, w1, b1, …` of `members` perceptrons with these layer sizes.

    w: (members, in, out), b: (members, 1, out), both uniform in ± 1/√in (torch's own default for
    linear layers), drawn from `rng` so that a model is a function of its recipe alone.
    """
    params: Params = {}
    for layer, (fan_in, fan_out) in enumerate(pairwise(sizes)):
        bound = 1 / math.sqrt(fan_in)
        for kind, shape in (("w", (members, fan_in, fan_out)), ("b", (members, 1, fan_out))):
            draw = rng.uniform(-bound, bound, size=shape).astype(np.float32)
            params[f"{kind}{layer}"] = torch.from_numpy(draw)
    return params


def mlp(
    params: Params,
    inputs: torch.Tensor,
    activation: Activation = "relu",
    dropout: float = 0.0,
    generator: torch.Generator | None = None,
) -> torch.Tensor:
    """All members on their inputs: (members, n, in) → (members, n, out), float32.

    Inputs of shape (n, in) are shown to every member. Dropout follows each hidden activation and
    draws from `generator`. A layer computes in the precision of its weights.
    """
    layers = len(params) // 2
    members = params["w0"].shape[0]
    hidden = inputs.expand(members, -1, -1) if inputs.dim() == 2 else inputs
    for layer in range(layers):
        weight = params[f"w{layer}"]
        hidden = torch.baddbmm(params[f"b{layer}"], hidden.to(weight.dtype), weight)
        if layer < layers - 1:
            hidden = ACTIVATIONS[activation](hidden)
            if dropout:
                keep = torch.empty_like(hidden).bernoulli_(1 - dropout, generator=generator)
                hidden = hidden * keep / (1 - dropout)
    return hidden.float()


def at_precision(params: Params, precision: Precision, *, output: bool = False) -> Params:
    """The same layers computing in that precision; the last one too where `output` asks for it.

    Values keep their last layer in float32: near 1 they change from one step to the next by about
    what bfloat16 rounds away.
    """
    last = len(params) // 2 - 1
    return {
        name: weight
        if name[1:] == str(last) and not output
        else weight.to(getattr(torch, precision))
        for name, weight in params.items()
    }


def prefixed(params: Params, prefix: str) -> dict[str, np.ndarray]:
    """Parameters as arrays named `prefix.name`, as artifacts keep them."""
    return {f"{prefix}.{name}": tensor.detach().numpy() for name, tensor in params.items()}


def prefixed_tensors(**groups: Params) -> Params:
    """Several networks' parameters in one dictionary, as "prefix.name"."""
    return {
        f"{prefix}.{name}": w for prefix, params in groups.items() for name, w in params.items()
    }


def named(weights: Mapping[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    """The arrays whose names begin with "prefix.", without it."""
    return {
        name.removeprefix(f"{prefix}."): array
        for name, array in weights.items()
        if name.startswith(f"{prefix}.")
    }


def parameters(weights: Mapping[str, np.ndarray], prefix: str) -> Params:
    """The parameters that `prefixed` named."""
    return {name: torch.from_numpy(array) for name, array in named(weights, prefix).items()}
