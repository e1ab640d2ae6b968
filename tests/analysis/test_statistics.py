import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from analysis.statistics import (
    ScoreCounts,
    bootstrap_means,
    count_scores,
    estimate,
    generator,
    interval,
    paired_differences,
    seed_means,
    wilson,
)


def long_form(scores: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(S, T, E) scores as one row per episode, NaN left out."""
    seeds, tasks, _ = np.indices(scores.shape)
    known = ~np.isnan(scores)
    return scores[known], seeds[known], tasks[known]


def counts_of(scores: np.ndarray) -> ScoreCounts:
    return count_scores(*long_form(scores))


def simulate(rng: np.random.Generator, shape: tuple[int, int, int]) -> np.ndarray:
    """Scores of two skills whose rates vary by seed and by task; true mean 0.5."""
    seed = rng.normal(0, 0.08, (shape[0], 1, 1))
    task = rng.normal(0, 0.08, (shape[0], shape[1], 1))
    return rng.binomial(2, np.clip(0.5 + seed + task, 0, 1), shape) / 2


def naive_bootstrap(scores: np.ndarray, rng: np.random.Generator, resamples: int) -> np.ndarray:
    """Seeds, then tasks, then episodes, one by one; NaN marks missing episodes."""
    by_seed = [[task[~np.isnan(task)] for task in seed] for seed in scores]
    by_seed = [[task for task in seed if len(task)] for seed in by_seed]
    means = []
    for _ in range(resamples):
        drawn = []
        for seed in rng.integers(len(by_seed), size=len(by_seed)):
            tasks = by_seed[seed]
            picked = [tasks[t] for t in rng.integers(len(tasks), size=len(tasks))]
            drawn.append(np.mean([rng.choice(task, len(task)).mean() for task in picked]))
        means.append(np.mean(drawn))
    return np.array(means)


def ragged(rng: np.random.Generator) -> np.ndarray:
    scores = simulate(rng, (3, 4, 12))
    scores[0, 0] = np.nan
    scores[1, 2, 5:] = np.nan
    return scores


def test_every_task_weighs_the_same_however_many_episodes_it_has() -> None:
    scores = np.array([[[1.0, 1.0, 1.0, 1.0], [0.0, np.nan, np.nan, np.nan]]])
    assert seed_means(counts_of(scores)).tolist() == [0.5]


@pytest.mark.parametrize("kind", ["balanced", "ragged"])
def test_agrees_with_the_naive_bootstrap(kind: str) -> None:
    rng = np.random.default_rng(3)
    scores = ragged(rng) if kind == "ragged" else simulate(rng, (3, 4, 12))
    fast = bootstrap_means(counts_of(scores), rng, 6000)
    slow = naive_bootstrap(scores, rng, 2000)
    assert fast.mean() == pytest.approx(slow.mean(), abs=0.006)
    assert fast.std() == pytest.approx(slow.std(), rel=0.08)
    assert interval(fast) == pytest.approx(interval(slow), abs=0.02)


def test_the_interval_covers_the_truth() -> None:
    """About 95 in 100 intervals; percentile intervals of twelve clusters are a little narrow."""
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(200):
        low, high = interval(bootstrap_means(counts_of(simulate(rng, (12, 6, 10))), rng, 300))
        covered += low <= 0.5 <= high
    assert 0.88 <= covered / 200 <= 0.99


def test_the_order_of_episodes_does_not_matter() -> None:
    scores, seeds, tasks = long_form(ragged(np.random.default_rng(1)))
    shuffle = np.random.default_rng(2).permutation(len(scores))
    first = estimate(count_scores(scores, seeds, tasks), generator("x"))
    second = estimate(count_scores(scores[shuffle], seeds[shuffle], tasks[shuffle]), generator("x"))
    assert first == second


def test_chunks_are_only_about_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks deal the stream out differently: other draws, but of the same estimate."""
    counts = counts_of(simulate(np.random.default_rng(1), (3, 5, 20)))
    whole = bootstrap_means(counts, generator("x"), 4000)
    monkeypatch.setattr("analysis.statistics.CHUNK", 1000)
    chunked = bootstrap_means(counts, generator("x"), 4000)
    assert chunked.mean() == pytest.approx(whole.mean(), abs=0.01)
    assert chunked.std() == pytest.approx(whole.std(), rel=0.1)


def test_one_seed_gives_an_interval_over_tasks_and_episodes_only() -> None:
    one = simulate(np.random.default_rng(1), (1, 6, 20))
    result = estimate(counts_of(one), generator("x"))
    assert result.seeds == 1
    assert result.variance == 0
    assert result.low < result.mean < result.high


def test_certain_scores_have_no_width() -> None:
    result = estimate(counts_of(np.ones((3, 4, 5))), generator("x"))
    assert (result.mean, result.low, result.high, result.std) == (1, 1, 1, 0)


def test_nothing_played_is_nan_and_not_zero() -> None:
    nothing = np.array([])
    result = estimate(count_scores(nothing, nothing, nothing), generator("x"))
    assert np.isnan([result.mean, result.low, result.high]).all()
    assert result.episodes == 0


def test_variance_is_over_seed_means_with_ddof_0() -> None:
    scores = np.array([0.2, 0.4, 0.9]).reshape(3, 1, 1)
    result = estimate(counts_of(scores), generator("x"))
    assert result.variance == pytest.approx(np.var([0.2, 0.4, 0.9]))
    assert result.std == pytest.approx(np.std([0.2, 0.4, 0.9]))


def test_streams_belong_to_names() -> None:
    assert generator("a", "bc").random() == generator("a", "bc").random()
    assert generator("a", "bc").random() != generator("ab", "c").random()


def test_pairs_are_matched_by_seed_task_and_episode() -> None:
    first = pd.DataFrame(
        {"seed": 0, "task": "a>b", "episode": [0, 1, 2], "length": 2, "accomplished": [2, 1, 0]}
    )
    second = first.assign(accomplished=[1, 1, 1])[::-1].query("episode > 0")
    pairs = paired_differences(first, second)
    assert sorted(pairs["difference"]) == [-0.5, 0]


def test_wilson_agrees_with_scipy() -> None:
    successes, trials = np.array([0, 1, 50, 100, 0]), np.array([100, 100, 100, 100, 0])
    low, high = wilson(successes, trials)
    for i in range(4):
        expected = binomtest(int(successes[i]), int(trials[i])).proportion_ci(method="wilson")
        assert (low[i], high[i]) == pytest.approx((expected.low, expected.high))
    assert np.isnan(low[4])


def test_a_kitchen_cell_takes_seconds_at_most() -> None:
    """840 tasks × 3 seeds × 100 episodes: the counts make it the work of 840 × 3 × 5 numbers."""
    rng = np.random.default_rng(0)
    counts = rng.multinomial(100, [0.5, 0.3, 0.1, 0.05, 0.05], size=(3, 840))
    means = bootstrap_means(ScoreCounts(np.arange(5) / 4, counts), rng)
    assert len(means) == 1000
