"""What intervals promise, tried on rollout trees whose truth is known: 7 skills, as in Kitchen.

Bounds leave room for the luck of a hundred trees and for what a percentile bootstrap of ten
episodes cannot do; taking tasks for independent would miss them all by far (0.45 and 0.53).
"""

import numpy as np
import pytest

from analysis.statistics import Scores, bootstrap_means, interval
from tests.analysis.rollout_tree import Tree, differences_of, scores_of

TREES, RESAMPLES, EPISODES = 100, 200, 10


def ends(scores: Scores, rng: np.random.Generator) -> tuple[float, float]:
    return interval(bootstrap_means(scores, rng, RESAMPLES))


def test_the_simulated_truth_is_the_mean_of_many_episodes() -> None:
    rng = np.random.default_rng(0)
    tree = Tree.grow(rng, 4, 3)
    assert scores_of([tree], rng, 40_000).values.mean() == pytest.approx(tree.mean(), abs=0.004)


@pytest.mark.parametrize("length", [2, 4])
def test_one_seed_covers_the_mean_of_its_own_models(length: int) -> None:
    rng = np.random.default_rng(length)
    covered = 0
    for _ in range(TREES):
        tree = Tree.grow(rng, 7, length)
        low, high = ends(scores_of([tree], rng, EPISODES), rng)
        covered += low <= tree.mean() <= high
    assert covered / TREES >= 0.87


@pytest.mark.parametrize("seeds", [1, 3])
def test_equal_methods_that_share_first_skills_are_rarely_told_apart(seeds: int) -> None:
    rng = np.random.default_rng(seeds)
    apart = 0
    for _ in range(TREES):
        tree = Tree.grow(rng, 7, 4)
        trees = [tree.retrained(rng, 0.15) for _ in range(seeds)]
        low, high = ends(differences_of(trees, rng, EPISODES), rng)
        apart += low > 0 or high < 0
    assert apart / TREES <= 0.14


@pytest.mark.parametrize(("effect", "promised"), [(0.0, 0.92), (0.15, 0.85), (0.4, 0.68)])
def test_three_seeds_cover_what_training_gives_as_far_as_three_can(
    effect: float, promised: float
) -> None:
    """The mean over all training runs: from above 95 % to the 75 % of three seeds' range."""
    rng = np.random.default_rng(3)
    base = Tree.grow(rng, 7, 3)
    truth = np.mean([base.retrained(rng, effect).mean() for _ in range(300)])
    covered = 0
    for _ in range(TREES):
        low, high = ends(
            scores_of([base.retrained(rng, effect) for _ in range(3)], rng, EPISODES), rng
        )
        covered += bool(low <= truth <= high)
    assert covered / TREES >= promised
