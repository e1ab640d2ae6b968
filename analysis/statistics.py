"""Means, gains and their intervals.

Tasks below one first skill are the same episodes for as long as their skills are the same, so they
are no more independent than one episode is of itself. Environments draw by (root seed, benchmark,
seed, episode, prefix); what is independent below a seed is therefore (first skill, episode).
"""

import hashlib
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import norm

from analysis.schema import SEPARATOR

RESAMPLES = 1000
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Scores:
    """A score for every seed, task and episode; NaN where it was not played."""

    values: np.ndarray  # (S, T, E)
    tasks: tuple[str, ...]  # (T,) "g0>g1"


@dataclass(frozen=True)
class Estimate:
    """A mean score with its spread over seeds and its bootstrap interval."""

    mean: float
    low: float
    high: float
    variance: float  # over seed means, ddof = 0
    std: float  # its square root
    episodes: int
    seeds: int


def generator(*names: str) -> np.random.Generator:
    """A stream that belongs to these names: the same cell gets the same draws in every run."""
    digest = hashlib.sha256("\x1f".join(names).encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "little")))


def arrange(episodes: pd.DataFrame, column: str) -> Scores:
    """A column of a frame with seed, task and episode; the order of its rows does not matter."""
    codes, labels = zip(
        *(pd.factorize(episodes[name], sort=True) for name in ("seed", "task", "episode")),
        strict=True,
    )
    values = np.full([len(names) for names in labels], np.nan)
    values[codes] = episodes[column]
    return Scores(values, tuple(labels[1]))


def seed_means(scores: Scores) -> np.ndarray:
    """(S,) each seed's mean over its tasks of their mean scores: every task weighs the same."""
    means = _task_means(scores.values)
    return np.array([seed[~np.isnan(seed)].mean() for seed in means])


def _task_means(values: np.ndarray) -> np.ndarray:
    """(S, T) means over the episodes that were played; NaN where there are none."""
    played = (~np.isnan(values)).sum(axis=2)
    return np.nansum(values, axis=2) / np.where(played > 0, played, np.nan)


def bootstrap_means(
    scores: Scores,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    *,
    other_tasks: bool = False,
) -> np.ndarray:
    """(resamples,) means under resampling of seeds, and below each of (first skill, episode).

    A seed trains everything anew and serves all tasks, so it is the cluster; with one seed the
    spread says nothing about other seeds. Episode numbers are drawn once for a seed and first
    skill, and the draw counts for all tasks below it. Tasks are all those there are, and stay as
    they are.

    With `other_tasks` they are a sample of such tasks: families, which begin with the same two
    skills, are drawn as well, the same for all seeds. As episodes are drawn within the families
    drawn, what differs between families by the luck of their episodes counts twice, and the
    spread is if anything too wide.
    """
    n_seeds = len(scores.values)
    seeds = rng.multinomial(n_seeds, np.full(n_seeds, 1 / n_seeds), size=resamples)
    prefixes = [task.split(SEPARATOR)[:2] for task in scores.tasks]
    family, names = pd.factorize(pd.Series(map(SEPARATOR.join, prefixes)))
    first = pd.factorize(pd.Series([name.split(SEPARATOR)[0] for name in names]))[0]
    weights = np.ones((resamples, len(names)))  # (B, F) how often a family was drawn
    if other_tasks:
        weights = _draw(np.ones(resamples, dtype=np.int64), len(names), rng)
    totals = np.zeros(resamples)
    for values, times in zip(scores.values, seeds.T, strict=True):
        totals += _seed_totals(values, family, first, weights, times, rng)
    return totals / n_seeds


def _seed_totals(
    values: np.ndarray,  # (T, E) of one seed
    family: np.ndarray,  # (T,) of each task
    first: np.ndarray,  # (F,) first skill of each family
    weights: np.ndarray,  # (B, F)
    times: np.ndarray,  # (B,) how often the seed was drawn, each time with its own episodes
    rng: np.random.Generator,
) -> np.ndarray:
    """(B,) summed means of a seed.

    A task's mean moves by Σ_e weight_e · (score_e − mean) / n over its n episodes e, which is
    linear: tasks of a family are added up before anything is drawn. With all episodes there the
    mean over the tasks is exactly that of the drawn episodes; where some are missing, or families
    differ in size, it is to first order, and a draw without any of a task's episodes does no harm.
    """
    played = ~np.isnan(values)
    means = _task_means(values[None])[0]  # (T,)
    known = ~np.isnan(means)
    mean, n_tasks = means[known].mean(), known.sum()
    member = family == np.arange(len(first))[:, None]  # (F, T)
    apart = member @ np.where(known, means - mean, 0)  # (F,) of its tasks from the seed's mean
    moved = np.where(played, values - means[:, None], 0) / np.maximum(played.sum(1), 1)[:, None]
    by_episode = member @ moved  # (F, E)
    totals = times * mean
    for skill in np.unique(first):
        below = first == skill
        units = played[member[below].any(axis=0)].any(axis=0)  # (E,) any task below was played
        if units.any():
            episodes = _draw(times, int(units.sum()), rng)  # (B, units)
            sums = times[:, None] * apart[below] + episodes @ by_episode[below][:, units].T
            totals += (weights[:, below] * sums).sum(axis=1) / n_tasks
    return totals


def _draw(times: np.ndarray, units: int, rng: np.random.Generator) -> np.ndarray:
    """(B, units) weights of units drawn with replacement, `times` (B,) over; they average it.

    One fewer is drawn than there are, for more weight each (Rao and Wu, 1988): the variance of a
    mean is then that of the usual unbiased estimate, where n of n would give (n - 1)/n of it.
    """
    drawn = max(units - 1, 1)
    return rng.multinomial(times * drawn, np.full(units, 1 / units)) * (units / drawn)


def interval(means: np.ndarray) -> tuple[float, float]:
    """The percentile interval of bootstrap means."""
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)


def estimate(scores: Scores, rng: np.random.Generator, resamples: int = RESAMPLES) -> Estimate:
    """Mean, spread over seeds and interval; all NaN if there is no episode.

    The variance divides by the number of seeds (ddof = 0), as numpy does by default and so
    presumably the paper; over three seeds ddof = 1 would be half as large again.
    """
    if scores.values.size == 0:
        return Estimate(np.nan, np.nan, np.nan, np.nan, np.nan, episodes=0, seeds=0)
    means = seed_means(scores)
    low, high = interval(bootstrap_means(scores, rng, resamples))
    variance = float(means.var())
    episodes = int((~np.isnan(scores.values)).sum())
    return Estimate(
        float(means.mean()), low, high, variance, float(np.sqrt(variance)), episodes, len(means)
    )


def paired_differences(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Episodes that both frames have, matched by seed, task and episode.

    Columns seed, task, episode, score_first, score_second, difference = first - second. Matched
    episodes share their environment's random numbers, and mostly their first skills, which the
    difference cancels. It is taken in whole accomplished skills, so that equal differences are
    equal numbers.
    """
    key = ["seed", "task", "episode"]
    pairs = first[[*key, "length", "accomplished"]].merge(
        second[[*key, "accomplished"]], on=key, suffixes=("_first", "_second")
    )
    length = pairs["length"]
    pairs["score_first"] = pairs["accomplished_first"] / length
    pairs["score_second"] = pairs["accomplished_second"] / length
    pairs["difference"] = (pairs["accomplished_first"] - pairs["accomplished_second"]) / length
    return pairs[[*key, "score_first", "score_second", "difference"]]


@dataclass(frozen=True)
class Gain:
    """How far one side is over another, over the episodes that both have; NaN if there are none."""

    difference: float  # first - second
    low: float
    high: float
    score_first: float
    score_second: float
    pairs: int
    seeds: int

    @property
    def relative(self) -> float:
        """The difference in units of the second's score; NaN if that is zero."""
        return self.difference / self.score_second if self.score_second > 0 else np.nan


def paired_gain(
    first: pd.DataFrame,
    second: pd.DataFrame,
    rng: np.random.Generator,
    *,
    other_tasks: bool = False,
) -> Gain:
    """The first over the second, every task and every seed weighing the same.

    `other_tasks`: whether the interval is to be about other tasks, too (see `bootstrap_means`).
    """
    pairs = paired_differences(first, second)
    if pairs.empty:
        return Gain(np.nan, np.nan, np.nan, np.nan, np.nan, pairs=0, seeds=0)
    differences, firsts, seconds = (
        arrange(pairs, name) for name in ("difference", "score_first", "score_second")
    )
    low, high = interval(bootstrap_means(differences, rng, other_tasks=other_tasks))
    return Gain(
        float(seed_means(differences).mean()),
        low,
        high,
        float(seed_means(firsts).mean()),
        float(seed_means(seconds).mean()),
        len(pairs),
        len(differences.values),
    )


def wilson(successes: np.ndarray, trials: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wilson's interval of rates: unlike ±1.96 σ it stays in [0, 1] and is right near both ends.

    Any shape; NaN where there were no trials.
    """
    successes, trials = np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
    n = np.where(trials > 0, trials, np.nan)
    z = float(norm.ppf((1 + CONFIDENCE) / 2))
    rate = successes / n
    centre = (rate + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(rate * (1 - rate) / n + z**2 / (4 * n**2))
    return np.clip(centre - half, 0, 1), np.clip(centre + half, 0, 1)
