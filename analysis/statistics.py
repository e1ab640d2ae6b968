"""Means, gains and their intervals.

Everything here works on how often each score was seen, (seeds, tasks, scores), because a task of
n skills has n + 1 possible scores: drawing episodes with replacement is then one multinomial
draw of counts, exactly and not approximately, however many episodes there are.
"""

import hashlib
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import norm

RESAMPLES = 1000
CONFIDENCE = 0.95
CHUNK = 4_000_000  # numbers held at once while resampling: 32 MB


@dataclass(frozen=True)
class ScoreCounts:
    """How often each score was seen; seeds and tasks without episodes have counts of zero."""

    values: np.ndarray  # (K,) the distinct scores
    counts: np.ndarray  # (S, T, K) episodes of seed s and task t with score k


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


def count_scores(scores: np.ndarray, seeds: np.ndarray, tasks: np.ndarray) -> ScoreCounts:
    """Counts of one row per episode, (N,) each; the order of the rows does not matter."""
    values, value = np.unique(scores, return_inverse=True)
    seed_codes, seed_ids = pd.factorize(seeds, sort=True)
    task_codes, task_ids = pd.factorize(tasks, sort=True)
    shape = (len(seed_ids), len(task_ids), len(values))
    cell = np.ravel_multi_index((seed_codes, task_codes, value), shape)
    return ScoreCounts(values, np.bincount(cell, minlength=int(np.prod(shape))).reshape(shape))


def seed_means(scores: ScoreCounts) -> np.ndarray:
    """(S,) each seed's mean over its tasks of their mean scores: every task weighs the same."""
    episodes = scores.counts.sum(axis=2)
    task_means = (scores.counts @ scores.values) / np.where(episodes > 0, episodes, 1)
    return task_means.sum(axis=1) / (episodes > 0).sum(axis=1)


def bootstrap_means(
    scores: ScoreCounts, rng: np.random.Generator, resamples: int = RESAMPLES
) -> np.ndarray:
    """(resamples,) means under resampling of seeds, then their tasks, then their episodes.

    A seed trains everything anew and serves all tasks, so it is the cluster. With one seed only
    tasks and episodes vary, and the spread says nothing about other seeds.
    """
    n_seeds = len(scores.counts)
    seed_draws = rng.multinomial(n_seeds, np.full(n_seeds, 1 / n_seeds), size=resamples)
    totals = np.zeros(resamples)
    for seed, counts in enumerate(scores.counts):
        played = counts[counts.sum(axis=1) > 0]  # (T, K)
        step = max(1, CHUNK // played.size)
        for start in range(0, resamples, step):
            chunk = slice(start, start + step)
            totals[chunk] += _seed_totals(played, scores.values, seed_draws[chunk, seed], rng)
    return totals / n_seeds


def _seed_totals(
    counts: np.ndarray, values: np.ndarray, seed_draws: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """(B,) summed means of a seed drawn `seed_draws` (B,) times, each time with its own tasks.

    A task drawn m times, each time with n episodes, is m·n episodes drawn at once.
    """
    n_tasks = len(counts)
    episodes = counts.sum(axis=1)  # (T,)
    task_draws = rng.multinomial(seed_draws * n_tasks, np.full(n_tasks, 1 / n_tasks))  # (B, T)
    score_draws = rng.multinomial(task_draws * episodes, counts / episodes[:, None])  # (B, T, K)
    return ((score_draws @ values) / episodes).sum(axis=1) / n_tasks


def interval(means: np.ndarray) -> tuple[float, float]:
    """The percentile interval of bootstrap means."""
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)


def estimate(scores: ScoreCounts, rng: np.random.Generator, resamples: int = RESAMPLES) -> Estimate:
    """Mean, spread over seeds and interval; all NaN if there is no episode.

    The variance divides by the number of seeds (ddof = 0), as numpy does by default and so
    presumably the paper; over three seeds ddof = 1 would be half as large again.
    """
    if scores.counts.size == 0:
        return Estimate(np.nan, np.nan, np.nan, np.nan, np.nan, episodes=0, seeds=0)
    means = seed_means(scores)
    low, high = interval(bootstrap_means(scores, rng, resamples))
    variance = float(means.var())
    episodes = int(scores.counts.sum())
    return Estimate(
        float(means.mean()), low, high, variance, float(np.sqrt(variance)), episodes, len(means)
    )


def paired_differences(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Episodes that both frames have, matched by seed, task and episode.

    Columns seed, task, score_first, score_second, difference = first - second. Matched episodes
    share their environment's random numbers, which the difference cancels. It is taken in whole
    accomplished skills, so that equal differences are equal numbers.
    """
    key = ["seed", "task", "episode"]
    pairs = first[[*key, "length", "accomplished"]].merge(
        second[[*key, "accomplished"]], on=key, suffixes=("_first", "_second")
    )
    length = pairs["length"]
    pairs["score_first"] = pairs["accomplished_first"] / length
    pairs["score_second"] = pairs["accomplished_second"] / length
    pairs["difference"] = (pairs["accomplished_first"] - pairs["accomplished_second"]) / length
    return pairs[["seed", "task", "score_first", "score_second", "difference"]]


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


def paired_gain(first: pd.DataFrame, second: pd.DataFrame, rng: np.random.Generator) -> Gain:
    """The first over the second, every task and every seed weighing the same."""
    pairs = paired_differences(first, second)
    if pairs.empty:
        return Gain(np.nan, np.nan, np.nan, np.nan, np.nan, pairs=0, seeds=0)
    seeds, tasks = pairs["seed"].to_numpy(), pairs["task"].to_numpy()
    differences, firsts, seconds = (
        count_scores(pairs[name].to_numpy(), seeds, tasks)
        for name in ("difference", "score_first", "score_second")
    )
    low, high = interval(bootstrap_means(differences, rng))
    return Gain(
        float(seed_means(differences).mean()),
        low,
        high,
        float(seed_means(firsts).mean()),
        float(seed_means(seconds).mean()),
        len(pairs),
        len(differences.counts),
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
