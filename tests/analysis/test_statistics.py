import time
from itertools import permutations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from analysis.statistics import (
    Scores,
    arrange,
    bootstrap_means,
    estimate,
    generator,
    interval,
    paired_differences,
    paired_gain,
    seed_means,
    wilson,
)

TASKS = ("a>b", "a>c", "b>a", "b>c")


def of(values: np.ndarray, tasks: tuple[str, ...] = TASKS) -> Scores:
    return Scores(np.asarray(values, dtype=float), tasks)


def long_form(scores: Scores) -> pd.DataFrame:
    """One row per episode that was played."""
    seed, task, episode = np.nonzero(~np.isnan(scores.values))
    return pd.DataFrame(
        {"seed": seed, "task": np.array(scores.tasks)[task], "episode": episode,
         "score": scores.values[seed, task, episode]}
    )  # fmt: skip


def simulate(rng: np.random.Generator, seeds: int = 3, episodes: int = 12) -> np.ndarray:
    """Scores of two skills; tasks with the same first skill share much of their luck."""
    seed = rng.normal(0, 0.08, (seeds, 1, 1))
    luck = np.repeat(rng.normal(0, 0.3, (seeds, 2, episodes)), 2, axis=1)
    return rng.binomial(2, np.clip(0.5 + seed + luck, 0, 1)) / 2


def ragged(rng: np.random.Generator) -> np.ndarray:
    scores = simulate(rng)
    scores[0, 0] = np.nan
    scores[1, 2, 5:] = np.nan
    return scores


def naive_bootstrap(scores: np.ndarray, rng: np.random.Generator, resamples: int) -> np.ndarray:
    """Seeds, then episodes of each first skill, one by one; NaN marks missing episodes."""
    episodes = scores.shape[2]
    means = []
    for _ in range(resamples):
        drawn = []
        for seed in rng.integers(len(scores), size=len(scores)):
            tasks = []
            for below in (scores[seed, :2], scores[seed, 2:]):
                picked = below[:, rng.integers(episodes, size=episodes - 1)]
                tasks += [task[~np.isnan(task)].mean() for task in picked if (task >= 0).any()]
            drawn.append(np.mean(tasks))
        means.append(np.mean(drawn))
    return np.array(means)


def test_every_task_weighs_the_same_however_many_episodes_it_has() -> None:
    scores = np.array([[[1.0, 1.0, 1.0, 1.0], [0.0, np.nan, np.nan, np.nan]]])
    assert seed_means(of(scores, TASKS[:2])).tolist() == [0.5]


@pytest.mark.parametrize("kind", ["balanced", "ragged"])
def test_agrees_with_the_naive_bootstrap(kind: str) -> None:
    rng = np.random.default_rng(3)
    scores = ragged(rng) if kind == "ragged" else simulate(rng)
    fast = bootstrap_means(of(scores), rng, 6000)
    slow = naive_bootstrap(scores, rng, 2000)
    assert fast.mean() == pytest.approx(slow.mean(), abs=0.006)
    assert fast.std() == pytest.approx(slow.std(), rel=0.08)
    assert interval(fast) == pytest.approx(interval(slow), abs=0.02)


def test_the_same_episodes_under_more_names_tell_nothing_more() -> None:
    """A task that only repeats another's episodes narrows no interval."""
    once = simulate(np.random.default_rng(1), seeds=2)[:, ::2]
    twice = np.repeat(once, 2, axis=1)
    apart = bootstrap_means(of(once, TASKS[::2]), generator("x"))
    assert np.allclose(bootstrap_means(of(twice), generator("x")), apart)


def test_the_variance_of_one_seed_is_the_usual_unbiased_one() -> None:
    one = simulate(np.random.default_rng(1), seeds=1, episodes=4)
    by_first = one[0].reshape(2, 2, 4).mean(axis=1)
    expected = (by_first.var(axis=1, ddof=1) / 4).sum() / 4
    assert bootstrap_means(of(one), generator("x"), 20_000).var() == pytest.approx(expected, 0.04)


def test_missing_episodes_do_not_move_the_middle() -> None:
    """Not even where a draw has none of the episodes of a task."""
    scores = ragged(np.random.default_rng(5))
    scores[2, 1, 1:] = np.nan
    means = bootstrap_means(of(scores), generator("x"), 20_000)
    assert means.mean() == pytest.approx(seed_means(of(scores)).mean(), abs=0.003)


def test_the_order_of_episodes_does_not_matter() -> None:
    rows = long_form(of(ragged(np.random.default_rng(1))))
    first = estimate(arrange(rows, "score"), generator("x"))
    shuffled = rows.sample(frac=1, random_state=2)
    assert estimate(arrange(shuffled, "score"), generator("x")) == first


def test_arranging_leaves_holes_where_nothing_was_played() -> None:
    scores = of(ragged(np.random.default_rng(1)))
    again = arrange(long_form(scores), "score")
    assert again.tasks == scores.tasks
    assert np.array_equal(again.values, scores.values, equal_nan=True)


def test_one_seed_gives_an_interval_over_episodes_only() -> None:
    one = simulate(np.random.default_rng(1), seeds=1)
    result = estimate(of(one), generator("x"))
    assert result.seeds == 1
    assert result.variance == 0
    assert result.low < result.mean < result.high


def test_tasks_are_fixed_unless_others_are_asked_about() -> None:
    """Certain scores of 0 and 1: nothing is uncertain about these tasks, much about others."""
    values = np.repeat([[[0.0], [0.0], [1.0], [1.0]]], 5, axis=2)
    assert np.ptp(bootstrap_means(of(values), generator("x"))) == 0
    others = bootstrap_means(of(values), generator("x"), other_tasks=True)
    assert others.mean() == pytest.approx(0.5, abs=0.03)
    assert others.std() == pytest.approx(np.std([0, 0, 1, 1], ddof=1) / 2, rel=0.05)


def test_tasks_of_one_family_are_drawn_together() -> None:
    values = np.repeat([[[0.0], [0.0], [1.0], [1.0]]], 5, axis=2)
    families = ("a>b>c", "a>b>d", "b>a>c", "b>a>d")
    others = bootstrap_means(of(values, families), generator("x"), other_tasks=True)
    assert set(others) == {0, 1}


def test_a_gain_asks_about_other_tasks_in_the_same_way() -> None:
    first = long_form(of(simulate(np.random.default_rng(1)))).assign(length=2)
    first["accomplished"] = (2 * first["score"]).astype(int)
    second = first.assign(accomplished=first["accomplished"].where(first["task"] == "a>b", 0))
    here = paired_gain(first, second, generator("x"))
    anywhere = paired_gain(first, second, generator("x"), other_tasks=True)
    assert here.difference == anywhere.difference
    assert anywhere.low < here.low < here.high < anywhere.high


def test_certain_scores_have_no_width() -> None:
    result = estimate(of(np.ones((3, 4, 5))), generator("x"))
    assert (result.mean, result.low, result.high, result.std) == (1, 1, 1, 0)


def test_nothing_played_is_nan_and_not_zero() -> None:
    nothing = pd.DataFrame({"seed": [], "task": [], "episode": [], "score": []})
    result = estimate(arrange(nothing, "score"), generator("x"))
    assert np.isnan([result.mean, result.low, result.high]).all()
    assert result.episodes == 0


def test_variance_is_over_seed_means_with_ddof_0() -> None:
    scores = np.array([0.2, 0.4, 0.9]).reshape(3, 1, 1)
    result = estimate(of(scores, TASKS[:1]), generator("x"))
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


@pytest.mark.parametrize("other_tasks", [False, True])
def test_a_kitchen_cell_takes_less_than_a_second(other_tasks: bool) -> None:
    """840 tasks × 3 seeds × 100 episodes, in seconds of this process and no other's."""
    tasks = tuple(">".join(task) for task in permutations("abcdefg", 4))
    scores = np.random.default_rng(0).integers(0, 5, (3, len(tasks), 100)) / 4
    began = time.process_time()
    bootstrap_means(of(scores, tasks), generator("x"), other_tasks=other_tasks)
    assert time.process_time() - began < 1
