"""Against their definitions, worked out number by number."""

import numpy as np
import pytest

from analysis.tables.distribution import THRESHOLDS, distribution, interquartile_mean, share_above


@pytest.fixture
def runs() -> np.ndarray:
    """(S, T) scores of tasks of two skills, five episodes each."""
    return np.random.default_rng(1).integers(0, 11, size=(3, 8)) / 10


def test_the_interquartile_mean_leaves_out_a_quarter_at_either_end(runs: np.ndarray) -> None:
    in_order = np.sort(runs.ravel())
    assert interquartile_mean(runs) == pytest.approx(in_order[6:18].mean())
    spoilt = np.where(runs == runs.max(), 100.0, runs)
    assert (runs == runs.max()).sum() <= 6
    assert interquartile_mean(spoilt) == pytest.approx(interquartile_mean(runs))


def test_the_share_is_of_scores_above_each_threshold(runs: np.ndarray) -> None:
    shares = share_above(runs)
    for threshold, share in zip(THRESHOLDS, shares, strict=True):
        assert share == pytest.approx((runs > threshold).mean())
    assert shares[-1] == 0
    assert (np.diff(shares) <= 0).all()


def test_statistics_of_many_at_once_are_those_of_each(runs: np.ndarray) -> None:
    drawn = runs[[[0, 1, 2], [0, 0, 2]]]
    for statistic in (interquartile_mean, share_above):
        np.testing.assert_allclose(statistic(drawn), [statistic(one) for one in drawn])


def test_intervals_are_of_resampled_seeds(runs: np.ndarray) -> None:
    """Of three seeds there are 27 draws: the bounds lie among what these give."""
    found = distribution(runs, np.random.default_rng(0))
    seeds = np.array(np.meshgrid(*[range(3)] * 3)).reshape(3, -1).T
    every = interquartile_mean(runs[seeds])
    assert every.min() <= found.iqm_low <= found.iqm <= found.iqm_high <= every.max()
    assert found.iqm_low == pytest.approx(np.quantile(every, 0.025, method="inverted_cdf"))
    assert (found.share_low <= found.share).all()
    assert (found.share <= found.share_high).all()
    assert (found.seeds, found.tasks) == runs.shape


def test_seeds_that_agree_leave_no_spread(runs: np.ndarray) -> None:
    found = distribution(np.tile(runs[:1], (3, 1)), np.random.default_rng(0))
    assert found.iqm_low == found.iqm == found.iqm_high
    np.testing.assert_array_equal(found.share_low, found.share_high)


def test_one_seed_has_no_interval(runs: np.ndarray) -> None:
    found = distribution(runs[:1], np.random.default_rng(0))
    assert found.iqm == pytest.approx(np.sort(runs[0])[2:6].mean())
    assert np.isnan([found.iqm_low, found.iqm_high]).all()
    assert np.isnan(found.share_low).all()


def test_a_score_at_a_threshold_is_not_above_it() -> None:
    """Whatever the last bit of its mean."""
    third = (0.1 + 0.2) * np.ones((1, 4))  # 0.30000000000000004
    found = distribution(third, np.random.default_rng(0))
    assert found.share[THRESHOLDS == 0.3] == 0
    assert found.share[THRESHOLDS == 0.29] == 1
