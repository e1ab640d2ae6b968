"""Equation 2: the conservative value of a predicted state, which every plan maximises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import torch

Norm = Literal["mean", "l2", "max"]
Price = Literal["end", "path"]  # what a plan's Var(T) is: its last state's, or its steps' mean

# The paper writes Var(T) of a vector-valued T as a scalar without saying how. "mean" lets β
# keep its meaning whatever the size of the observation.
NORMS: dict[Norm, Callable[[torch.Tensor], torch.Tensor]] = {
    "mean": lambda spread: spread.mean(dim=-1),
    "l2": lambda spread: torch.linalg.vector_norm(spread, dim=-1),
    "max": lambda spread: spread.amax(dim=-1),
}


def conservative_value(
    values: torch.Tensor, next_states: torch.Tensor, alpha: float, beta: float, norm: Norm = "mean"
) -> torch.Tensor:
    """v_ensemble(s') = E[v(s')] − α·Var(v(s')) − β·Var(T(s'|s, a))   (Eq. 2).

    As in the paper, E is the mean over the members of an ensemble and "Var" their standard
    deviation (population form: a single member has none).

    Args:
        values: (M, ...), v(s') by each value member at the mean predicted state.
        next_states: (D, ..., observation), s' by each dynamics member, every dimension in units
            of its scale in the data: Var(T) adds up dimensions of different units.
        alpha: α, the price of disagreement between value members.
        beta: β, the price of disagreement between dynamics members.
        norm: reduces Var(T) over the dimensions of the observation.

    Returns:
        (...), the conservative value.
    """
    state_spread = NORMS[norm](spread_over_members(next_states))
    return values.mean(dim=0) - alpha * spread_over_members(values) - beta * state_spread


def spread_over_members(predictions: torch.Tensor) -> torch.Tensor:
    """Population standard deviation over the first dimension: (members, ...) → (...)."""
    # Tensor.std is not vectorised over the first dimension: some 30 times slower on a CPU.
    return (predictions - predictions.mean(dim=0)).square().mean(dim=0).sqrt()
