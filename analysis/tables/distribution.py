"""How scores are distributed over tasks: interquartile means and performance profiles.

After Agarwal et al., “Deep Reinforcement Learning at the Edge of the Statistical Precipice” (2021).
A run, as they call it, is the mean score of one task under the models of one seed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import trim_mean

from analysis.statistics import CONFIDENCE, RESAMPLES, generator

MANY = 10  # tasks of a row; of fewer a quarter is hardly one
THRESHOLDS = np.arange(101) / 100
DECIMALS = 9  # equal scores are equal numbers, to the thresholds too


@dataclass(frozen=True)
class Distribution:
    """Of S seeds' scores on T tasks; bounds are NaN with one seed, which resampling cannot move."""

    mean: float
    iqm: float
    iqm_low: float
    iqm_high: float
    share: np.ndarray  # (K,) of the runs with a score above each of THRESHOLDS
    share_low: np.ndarray  # (K,)
    share_high: np.ndarray  # (K,)
    seeds: int
    tasks: int


def cell_distributions(
    task_scores: pd.DataFrame, table: str
) -> dict[tuple[str, str], Distribution]:
    """(row, method) → over the tasks that all seeds have played; none where they are not many.

    task_scores: row, method, seed, task, score.
    """
    found = {}
    for (row, method), part in task_scores.groupby(["row", "method"], sort=False):
        runs = part.pivot_table("score", "seed", "task").dropna(axis=1).to_numpy()
        if runs.shape[1] >= MANY:
            rng = generator("distribution", table, str(row), str(method))
            found[str(row), str(method)] = distribution(runs, rng)
    return found


def distribution(runs: np.ndarray, rng: np.random.Generator) -> Distribution:
    """Of runs (S, T), with 95 % intervals from resampling seeds.

    A seed serves all tasks, so it is drawn with all of its scores.
    """
    runs = np.round(runs, DECIMALS)
    iqm_low, iqm_high = _bounds(runs, interquartile_mean, rng)
    share_low, share_high = _bounds(runs, share_above, rng)
    return Distribution(
        float(runs.mean()), float(interquartile_mean(runs)), float(iqm_low), float(iqm_high),
        share_above(runs), share_low, share_high, *runs.shape,
    )  # fmt: skip


def interquartile_mean(runs: np.ndarray) -> np.ndarray:
    """(…, S, T) → (…): the mean of all runs but a quarter at either end."""
    return np.asarray(trim_mean(runs.reshape(*runs.shape[:-2], -1), 0.25, axis=-1))


def share_above(runs: np.ndarray) -> np.ndarray:
    """(…, S, T) → (…, K): the share of the runs with a score above each of THRESHOLDS."""
    in_order = np.sort(runs.reshape(-1, runs.shape[-2] * runs.shape[-1]), axis=-1)
    below = np.array([np.searchsorted(each, THRESHOLDS, side="right") for each in in_order])
    return (1 - below / in_order.shape[-1]).reshape(*runs.shape[:-2], len(THRESHOLDS))


def _bounds(
    runs: np.ndarray, statistic: Callable[[np.ndarray], np.ndarray], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The statistic's 95 % interval, element by element."""
    seeds = len(runs)
    if seeds == 1:
        unknown = np.full_like(statistic(runs), np.nan)
        return unknown, unknown
    drawn = statistic(runs[rng.integers(seeds, size=(RESAMPLES, seeds))])
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(drawn, [tail, 1 - tail], axis=0)
    return low, high
