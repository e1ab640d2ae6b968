"""What to know of models before a planner is judged by them: all on data that none was trained on.

Of the dynamics how far their predictions are off and whether the ensemble's disagreement says so;
of the values whether they rise along demonstrations; of both how large the two variances of Eq. 2
are; of the policies whether they work where their own data begin.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import compress
from typing import Any

import numpy as np
import torch
from scipy.stats import spearmanr

from stitching.data.transitions import Transitions
from stitching.envs.protocol import Benchmark
from stitching.methods.no_stitch import NoStitch
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.objective import NORMS, spread_over_members
from stitching.rollout import Block, RolloutConfig, play_segment

MOST_TRIALS = 100  # of each skill's policy
SHOWN_POINTS = 500  # of disagreement against error
SHOWN_CURVES = 20  # of each skill's demonstrations
GRID = 21  # points of progress at which values are averaged


@torch.inference_mode()
def prediction_errors(
    dynamics: Dynamics, data: Transitions, groups: Mapping[str, slice], horizon: int
) -> dict[str, Any]:
    """Errors of the ensemble's mean after 1 and `horizon` demonstrated actions, open loop.

    By group of dimensions, each dimension in units of its standard deviation in the training data:
    rmse, and of that the share of how far the state moved ("relative"; 1 is no better than
    predicting that nothing moves). Rank correlation (Spearman) of disagreement, the members'
    spread averaged over dimensions, with the absolute error, averaged alike.
    """
    starts = [
        np.arange(start, end - horizon + 1)
        for start, end in zip(data.episode_starts, data.episode_ends, strict=True)
    ]
    first = torch.from_numpy(np.concatenate(starts))
    actions, after = torch.from_numpy(data.actions), torch.from_numpy(data.next_observations)
    before = torch.from_numpy(data.observations)[first]
    imagined = before.unsqueeze(0)
    study: dict[str, Any] = {}
    for step in range(horizon):
        imagined = dynamics(imagined, actions[first + step])
        if step in (0, horizon - 1):
            error = dynamics.scaled(imagined.mean(dim=0) - after[first + step])
            moved = dynamics.scaled(before - after[first + step])
            spread = spread_over_members(dynamics.scaled(imagined)).mean(dim=-1)
            size = error.abs().mean(dim=-1)
            shown = torch.linspace(0, len(first) - 1, min(SHOWN_POINTS, len(first))).long()
            study[str(step + 1)] = {
                "states": len(first),
                "groups": {
                    name: {
                        "rmse": _root_mean_square(error[:, part]),
                        "relative": _root_mean_square(error[:, part])
                        / _root_mean_square(moved[:, part]),
                    }
                    for name, part in groups.items()
                },
                "disagreement_rank_correlation": _rank_correlation(spread, size),
                "points": torch.stack([spread, size], dim=1)[shown].tolist(),
            }
    return study


def _root_mean_square(numbers: torch.Tensor) -> float:
    return float(numbers.square().mean().sqrt())


def _rank_correlation(first: Any, second: Any) -> float:
    """Spearman's; 0 where one of them is constant."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return float(spearmanr(first, second).statistic)


@torch.inference_mode()
def value_progress(agent: Agent, benchmark: Benchmark, data: Transitions) -> dict[str, Any]:
    """How E[V] rises along each skill's successful demonstrations: per skill, on average over them.

    "rank_correlation" is Spearman's, of value with time, each demonstration by itself; "mean" and
    "spread" (of the members) are averages at equal shares of progress.
    """
    study = {}
    for index, skill in enumerate(benchmark.skills):
        correlations, curves, spreads = [], [], []
        own = data.episode_successes[data.episode_skills == index]
        for rows in compress(data.episode_rows(index), own):
            values = agent.values(torch.from_numpy(data.observations[rows]), index)
            mean, spread = values.mean(dim=0).numpy(), spread_over_members(values).numpy()
            if len(rows) > 2:
                correlations.append(_rank_correlation(np.arange(len(rows)), mean))
            at = np.linspace(0, 1, GRID)
            progress = np.linspace(0, 1, len(rows))
            curves.append(np.interp(at, progress, mean))
            spreads.append(np.interp(at, progress, spread))
        if curves:
            study[skill.name] = {
                "demonstrations": len(curves),
                "rank_correlation": float(np.mean(correlations)),
                "mean": np.mean(curves, axis=0).tolist(),
                "spread": np.mean(spreads, axis=0).tolist(),
                "curves": np.array(curves[:SHOWN_CURVES]).round(4).tolist(),
            }
    return study


@torch.inference_mode()
def prices(
    agent: Agent, dynamics: Dynamics, benchmark: Benchmark, data: Transitions, horizon: int
) -> dict[str, Any]:
    """The two variances of Eq. 2 after `horizon` demonstrated actions: per skill, on average.

    As a planner has them: values at the mean of the members' predicted states, each dynamics member
    on a path of its own, Var(T) by the norm "mean". Where α and β are equal, Var(T) costs
    "dynamics_spread" / "value_spread" times what Var(V) does.
    """
    study = {}
    for index, skill in enumerate(benchmark.skills):
        within = [rows[: max(0, len(rows) - horizon + 1)] for rows in data.episode_rows(index)]
        first = np.concatenate([np.zeros(0, dtype=np.int64), *within])
        if not len(first):
            continue
        sequences = torch.from_numpy(data.actions[first[:, None] + np.arange(horizon)])
        imagined = dynamics.imagine(torch.from_numpy(data.observations[first]), sequences)
        values = agent.values(imagined.mean(dim=0), index)
        disagreement = NORMS["mean"](spread_over_members(dynamics.scaled(imagined)))
        study[skill.name] = {
            "states": len(first),
            "value_spread": float(spread_over_members(values).mean()),
            "dynamics_spread": float(disagreement.mean()),
        }
    return study


def competence(
    agent: Agent,
    benchmark: Benchmark,
    config: RolloutConfig,
    step_limit: int,
    data: Transitions,
    starts: np.ndarray,
    root_seed: int,
    seed: int,
) -> dict[str, Any]:
    """How often each skill's policy succeeds from where its own held-out demonstrations begin.

    starts: (E, snapshot) float64, of each episode of `data`; up to 100 of each skill are tried.
    """
    study = {}
    for index, skill in enumerate(benchmark.skills):
        own = np.flatnonzero(data.episode_skills == index)[:MOST_TRIALS]
        if not len(own):
            continue
        episodes = tuple(range(len(own)))
        block = Block(root_seed, benchmark.name, seed, "", episodes, (skill.name,))
        env = benchmark.vector_env()
        env.restore(starts[own], block.streams("held-out"))
        budget = np.full(len(own), step_limit)
        outcome = play_segment(env, agent, NoStitch(), benchmark, config, block, budget)
        study[skill.name] = {
            "trials": len(own),
            "successes": int(outcome.success.sum()),
            "steps": float(outcome.steps[outcome.success].mean()) if outcome.success.any() else 0.0,
        }
    return study
