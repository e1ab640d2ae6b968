"""Stacked perceptrons against one plain float64 perceptron at a time; dropout; initial weights."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from stitching.models.layers import (
    Activation,
    Params,
    at_precision,
    init_mlp,
    mlp,
    parameters,
    prefixed,
)
from stitching.streams import stream

PLAIN: dict[Activation, Callable[[np.ndarray], np.ndarray]] = {
    "relu": lambda x: np.maximum(x, 0),
    "elu": lambda x: np.where(x > 0, x, np.expm1(np.minimum(x, 0))),
    "sigmoid": lambda x: 1 / (1 + np.exp(-x)),
}


def plain_mlp(params: Params, member: int, row: np.ndarray, activation: Activation) -> np.ndarray:
    """One member on one input."""
    layers = len(params) // 2
    for layer in range(layers):
        w = params[f"w{layer}"][member].double().numpy()
        b = params[f"b{layer}"][member, 0].double().numpy()
        row = np.array([row @ w[:, out] + b[out] for out in range(w.shape[1])])
        if layer < layers - 1:
            row = PLAIN[activation](row)
    return row


def plain_outputs(params: Params, inputs: torch.Tensor, activation: Activation) -> np.ndarray:
    """(members, n, in) → (members, n, out)"""
    return np.array(
        [
            [plain_mlp(params, member, row, activation) for row in rows]
            for member, rows in enumerate(inputs.double().numpy())
        ]
    )


def normal(*shape: int, seed: int = 0) -> torch.Tensor:
    rng = np.random.default_rng(seed)
    return torch.from_numpy(rng.standard_normal(shape, dtype=np.float32))


@given(
    members=st.integers(1, 4),
    sizes=st.lists(st.integers(1, 9), min_size=2, max_size=5),
    rows=st.integers(1, 6),
    activation=st.sampled_from(sorted(PLAIN)),
    seed=st.integers(0, 99),
)
def test_each_member_is_a_plain_perceptron(
    members: int, sizes: list[int], rows: int, activation: Activation, seed: int
) -> None:
    params = init_mlp(members, sizes, stream(seed))
    inputs = normal(members, rows, sizes[0], seed=seed)
    outputs = mlp(params, inputs, activation)
    assert outputs.shape == (members, rows, sizes[-1])
    np.testing.assert_allclose(outputs, plain_outputs(params, inputs, activation), atol=1e-5)


def test_wide_networks_as_in_kitchen() -> None:
    params, inputs = init_mlp(5, [68, 192, 192, 59], stream(0)), normal(5, 4, 68)
    np.testing.assert_allclose(
        mlp(params, inputs, "elu"), plain_outputs(params, inputs, "elu"), atol=1e-5
    )


def test_inputs_without_members_are_shown_to_all() -> None:
    params, inputs = init_mlp(3, [4, 8, 2], stream(0)), normal(7, 4)
    assert torch.equal(mlp(params, inputs), mlp(params, inputs.expand(3, -1, -1)))
    np.testing.assert_allclose(
        mlp(params, inputs), plain_outputs(params, inputs.expand(3, -1, -1), "relu"), atol=1e-5
    )


def test_members_do_not_mix() -> None:
    params, inputs = init_mlp(3, [4, 8, 2], stream(0)), normal(3, 5, 4)
    before = mlp(params, inputs)
    params["w0"][1] += 1
    inputs[1] *= 2
    after = mlp(params, inputs)
    assert torch.equal(after[[0, 2]], before[[0, 2]])
    assert not torch.equal(after[1], before[1])


def test_no_dropout_unless_asked_for() -> None:
    params, inputs = init_mlp(1, [4, 64, 2], stream(0)), normal(5, 4)
    state = torch.get_rng_state()
    assert torch.equal(mlp(params, inputs), mlp(params, inputs))
    assert torch.equal(torch.get_rng_state(), state)
    dropped = mlp(params, inputs, dropout=0.1, generator=torch.Generator().manual_seed(0))
    assert not torch.equal(dropped, mlp(params, inputs))


def units(width: int, hidden_layers: int = 1) -> Params:
    """Hidden units that all hold the input, and outputs that show each of them."""
    first = {"w0": torch.ones(1, 1, width), "b0": torch.zeros(1, 1, width)}
    later: Params = {}
    for layer in range(1, hidden_layers + 1):
        later |= {f"w{layer}": torch.eye(width)[None], f"b{layer}": torch.zeros(1, 1, width)}
    return first | later


@pytest.mark.parametrize("rate", [0.1, 0.5])
def test_dropout_keeps_the_mean(rate: float) -> None:
    generator = torch.Generator().manual_seed(0)
    kept = mlp(units(width=500), torch.ones(20, 1), dropout=rate, generator=generator)
    torch.testing.assert_close(kept.unique(), torch.tensor([0.0, 1 / (1 - rate)]))
    # Four standard errors of a fraction among 10,000.
    error = 4 * math.sqrt(rate * (1 - rate) / 10_000)
    assert (kept == 0).float().mean().item() == pytest.approx(rate, abs=error)
    assert kept.mean().item() == pytest.approx(1, abs=error / (1 - rate))


def test_dropout_follows_every_hidden_layer_and_no_other() -> None:
    generator = torch.Generator().manual_seed(0)
    twice = mlp(units(500, 2), torch.ones(20, 1), dropout=0.5, generator=generator)
    torch.testing.assert_close(twice.unique(), torch.tensor([0.0, 4.0]))
    assert (twice == 4).float().mean().item() == pytest.approx(0.25, abs=0.02)
    linear = {"w0": torch.eye(100)[None], "b0": torch.zeros(1, 1, 100)}
    assert torch.equal(mlp(linear, torch.ones(1, 100), dropout=0.9), torch.ones(1, 1, 100))


def test_dropout_draws_from_its_generator_alone() -> None:
    params, inputs = init_mlp(2, [4, 32, 2], stream(0)), normal(5, 4)

    def dropped(seed: int) -> torch.Tensor:
        return mlp(params, inputs, dropout=0.3, generator=torch.Generator().manual_seed(seed))

    state = torch.get_rng_state()
    assert torch.equal(dropped(1), dropped(1))
    assert not torch.equal(dropped(1), dropped(2))
    assert torch.equal(torch.get_rng_state(), state)


def test_rows_and_members_are_dropped_apart() -> None:
    params = {name: tensor.expand(2, -1, -1) for name, tensor in units(50).items()}
    generator = torch.Generator().manual_seed(0)
    kept = mlp(params, torch.ones(3, 1), dropout=0.5, generator=generator)
    assert len(kept.flatten(0, 1).unique(dim=0)) == 6


def test_initial_weights_are_uniform_in_torchs_own_bounds() -> None:
    params = init_mlp(3, [100, 50, 2], stream(0))
    assert {name: tuple(tensor.shape) for name, tensor in params.items()} == {
        "w0": (3, 100, 50),
        "b0": (3, 1, 50),
        "w1": (3, 50, 2),
        "b1": (3, 1, 2),
    }
    for name, fan_in in (("w0", 100), ("b0", 100), ("w1", 50)):
        bound = 1 / math.sqrt(fan_in)
        assert params[name].dtype == torch.float32
        spread = params[name].flatten().numpy() / bound
        assert kstest(spread, "uniform", args=(-1, 2)).pvalue > 0.01, name


def test_initial_weights_come_from_the_stream_alone() -> None:
    torch.manual_seed(0)
    first = init_mlp(2, [3, 4, 1], stream("a"))
    torch.manual_seed(1)
    again, other = init_mlp(2, [3, 4, 1], stream("a")), init_mlp(2, [3, 4, 1], stream("b"))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first)
    assert not torch.equal(first["w0"][0], first["w0"][1])


def test_parameters_find_what_prefixed_named() -> None:
    q, q_target = init_mlp(2, [3, 4, 1], stream("q")), init_mlp(2, [3, 4, 1], stream("target"))
    weights = prefixed(q, "q") | prefixed(q_target, "q_target") | {"q": np.zeros(1)}
    for prefix, params in (("q", q), ("q_target", q_target)):
        found = parameters(weights, prefix)
        assert found.keys() == params.keys()
        assert all(torch.equal(found[name], params[name]) for name in params)
    assert parameters(weights, "v") == {}


def test_prefixed_takes_trained_parameters() -> None:
    params = init_mlp(1, [2, 1], stream(0))
    params["w0"].requires_grad_()
    array = prefixed(params, "v")["v.w0"]
    assert isinstance(array, np.ndarray)
    np.testing.assert_array_equal(array, params["w0"].detach().numpy())


@pytest.mark.parametrize("output", [False, True])
def test_half_precision_is_off_by_its_rounding_alone(output: bool) -> None:
    params = init_mlp(3, [66, 192, 192, 1], stream("wide"))
    inputs = torch.from_numpy(stream("inputs").standard_normal((3, 64, 66), dtype=np.float32))
    exact = mlp(params, inputs)
    layers = at_precision(params, "bfloat16", output=output)
    assert layers["w0"].dtype == torch.bfloat16
    assert layers["w2"].dtype == (torch.bfloat16 if output else torch.float32)
    half = mlp(layers, inputs)
    assert half.dtype == torch.float32
    assert 0 < (half - exact).abs().max() < 2**-7 * exact.abs().max()


def test_full_precision_changes_nothing() -> None:
    params = init_mlp(2, [5, 7, 3], stream("small"))
    layers = at_precision(params, "float32")
    assert all(layers[name] is weight for name, weight in params.items())


def test_half_precision_trains_the_full_weights() -> None:
    params = init_mlp(1, [5, 7, 3], stream("small"))
    for weight in params.values():
        weight.requires_grad_()
    mlp(at_precision(params, "bfloat16"), torch.ones(4, 5)).square().sum().backward()
    assert all(w.grad is not None and w.grad.dtype == torch.float32 for w in params.values())
