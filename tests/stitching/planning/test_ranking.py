"""Scores that are not finite lose; a problem that has no other stops the run, by name."""

import pytest
import torch

from stitching.planning.ranking import sortable

INF, NAN = torch.inf, torch.nan


def test_what_is_not_finite_loses() -> None:
    scores = torch.tensor([[1.0, NAN, 2.0], [INF, -INF, -3.0]])
    ranked = sortable(scores, torch.arange(2))
    assert ranked.tolist() == [[1.0, -INF, 2.0], [-INF, -INF, -3.0]]


def test_finite_scores_pass_unchanged() -> None:
    scores = torch.randn(3, 4)
    assert torch.equal(sortable(scores, torch.arange(3)), scores)


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_names_the_problem_without_a_finite_score(value: float) -> None:
    scores = torch.tensor([[0.0, 0.0], [value, value]])
    with pytest.raises(FloatingPointError, match=r"problem\(s\) \[17\]"):
        sortable(scores, torch.tensor([4, 17]))
