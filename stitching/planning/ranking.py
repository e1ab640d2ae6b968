"""Scores that can be ranked: what planners do about NaN and infinity."""

from __future__ import annotations

import torch


def sortable(scores: torch.Tensor, problems: torch.Tensor) -> torch.Tensor:
    """Scores with everything that is not finite at −∞, so that it loses to all that is.

    A learned model driven far outside its data may overflow. +∞ comes from that, not from a good
    plan, so it loses too.

    Args:
        scores: (problems, population).
        problems: (problems,), the index by which an error names each row.

    Raises:
        FloatingPointError: a problem has no finite score.
    """
    finite = scores.isfinite()
    hopeless = problems[~finite.any(dim=1)]
    if len(hopeless):
        raise FloatingPointError(
            f"no action sequence has a finite score for problem(s) {hopeless.tolist()}: check the "
            "dynamics and value models, and the states planned from, for NaN or infinity"
        )
    return scores.where(finite, -torch.inf)
