"""Eq. 2 against a plain float64 transcription of it, and what it must do whatever the numbers."""

from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stitching.planning.objective import NORMS, Norm, conservative_value

POPULATION, OBSERVATION = 4, 3
REDUCE: dict[Norm, Callable[[list[np.floating[Any]]], np.floating[Any]]] = {
    "mean": np.mean,
    "l2": np.linalg.norm,
    "max": np.max,
}

members = st.integers(1, 6)
numbers = st.floats(-10, 10, width=32)
prices = st.floats(0, 20, width=32)
norms = st.sampled_from(sorted(NORMS))


@st.composite
def ensembles(draw: st.DrawFn) -> tuple[torch.Tensor, torch.Tensor]:
    values = draw(arrays(np.float32, (draw(members), POPULATION), elements=numbers))
    states = draw(arrays(np.float32, (draw(members), POPULATION, OBSERVATION), elements=numbers))
    return torch.from_numpy(values), torch.from_numpy(states)


def equation_2(
    values: np.ndarray, states: np.ndarray, alpha: float, beta: float, norm: Norm
) -> list[float]:
    return [
        np.mean(values[:, i])
        - alpha * np.std(values[:, i])
        - beta * REDUCE[norm]([np.std(states[:, i, k]) for k in range(OBSERVATION)])
        for i in range(POPULATION)
    ]


@given(ensembles(), prices, prices, norms)
def test_is_equation_2(
    ensemble: tuple[torch.Tensor, torch.Tensor], alpha: float, beta: float, norm: Norm
) -> None:
    values, states = ensemble
    expected = equation_2(values.double().numpy(), states.double().numpy(), alpha, beta, norm)
    actual = conservative_value(values, states, alpha, beta, norm)
    assert actual.shape == (POPULATION,)
    np.testing.assert_allclose(actual, expected, rtol=1e-4, atol=1e-3)


@given(ensembles(), prices, prices, norms, st.randoms(use_true_random=False))
def test_the_order_of_members_means_nothing(
    ensemble: tuple[torch.Tensor, torch.Tensor],
    alpha: float,
    beta: float,
    norm: Norm,
    random: Random,
) -> None:
    values, states = ensemble
    shuffled_values = values[random.sample(range(len(values)), len(values))]
    shuffled_states = states[random.sample(range(len(states)), len(states))]
    torch.testing.assert_close(
        conservative_value(shuffled_values, shuffled_states, alpha, beta, norm),
        conservative_value(values, states, alpha, beta, norm),
        rtol=1e-4,
        atol=1e-3,
    )


@given(ensembles(), members, members, prices, prices, norms)
def test_members_that_agree_cost_nothing(
    ensemble: tuple[torch.Tensor, torch.Tensor],
    M: int,
    D: int,
    alpha: float,
    beta: float,
    norm: Norm,
) -> None:
    values, states = ensemble
    agreed = conservative_value(
        values[:1].expand(M, -1), states[:1].expand(D, -1, -1), alpha, beta, norm
    )
    torch.testing.assert_close(agreed, values[0], rtol=1e-4, atol=1e-3)


@given(ensembles(), prices, prices, st.floats(0, 5, width=32), norms)
def test_a_higher_price_of_disagreement_never_raises_the_value(
    ensemble: tuple[torch.Tensor, torch.Tensor],
    alpha: float,
    beta: float,
    more: float,
    norm: Norm,
) -> None:
    at_price = conservative_value(*ensemble, alpha, beta, norm)
    assert (conservative_value(*ensemble, alpha + more, beta, norm) <= at_price).all()
    assert (conservative_value(*ensemble, alpha, beta + more, norm) <= at_price).all()


@pytest.mark.parametrize("norm", sorted(NORMS))
def test_single_members_give_their_value(norm: Norm) -> None:
    values, states = torch.randn(1, 2, 7), torch.randn(1, 2, 7, 5)
    assert torch.equal(conservative_value(values, states, 7.0, 5.0, norm), values[0])


@pytest.mark.parametrize("norm", sorted(NORMS))
def test_a_free_penalty_still_sees_a_diverged_model(norm: Norm) -> None:
    values, states = torch.zeros(2, 3), torch.zeros(2, 3, 4)
    states[0, 1, 2] = torch.nan
    assert conservative_value(values, states, 0.0, 0.0, norm).isnan().tolist() == [0, 1, 0]


def test_norms_on_known_spreads() -> None:
    values = torch.zeros(1, 1)
    states = torch.tensor([[[3.0, 4.0]], [[-3.0, -4.0]]])  # spreads 3 and 4
    assert conservative_value(values, states, 0.0, 1.0, "mean").item() == pytest.approx(-3.5)
    assert conservative_value(values, states, 0.0, 1.0, "l2").item() == pytest.approx(-5.0)
    assert conservative_value(values, states, 0.0, 1.0, "max").item() == pytest.approx(-4.0)
