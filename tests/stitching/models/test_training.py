"""Learning curves, the alarm on divergence, and the decay of learning rates."""

import numpy as np
import pytest
import torch

from stitching.models.training import CurveLog, cosine


def recorded(updates: int, every: int) -> list[int]:
    log = CurveLog(updates, every)
    for update in range(updates):
        log.record(update, {"loss": torch.tensor(float(update))})
    assert [value for _, value in log.curves["loss"]] == [n - 1 for n, _ in log.curves["loss"]]
    return [n for n, _ in log.curves["loss"]]


@pytest.mark.parametrize(
    ("updates", "every", "expected"),
    [
        (10, 3, [3, 6, 9, 10]),
        (9, 3, [3, 6, 9]),
        (2, 5, [2]),
        (3, 1, [1, 2, 3]),
    ],
)
def test_every_so_many_updates_and_the_last(updates: int, every: int, expected: list[int]) -> None:
    assert recorded(updates, every) == expected


def test_curves_go_by_name() -> None:
    log = CurveLog(updates=2, every=1)
    log.record(0, {"a": torch.tensor(1.0), "b": torch.tensor(2.0)})
    log.record(1, {"a": torch.tensor(3.0), "b": torch.tensor(4.0)})
    assert log.curves == {"a": [(1, 1.0), (2, 3.0)], "b": [(1, 2.0), (2, 4.0)]}


def test_logs_do_not_share_their_curves() -> None:
    CurveLog(updates=1, every=1).record(0, {"a": torch.tensor(1.0)})
    assert CurveLog(updates=1, every=1).curves == {}


@pytest.mark.parametrize("value", [torch.nan, torch.inf, -torch.inf])
def test_divergence_is_named_with_its_update(value: float) -> None:
    log = CurveLog(updates=10, every=4)
    losses = {"q_loss": torch.tensor(1.0), "value_loss": torch.tensor(value)}
    log.record(0, losses)  # not looked at yet
    with pytest.raises(FloatingPointError, match=r"value_loss is .* at update 4"):
        log.record(3, losses)


def test_divergence_after_the_last_round_number_is_found() -> None:
    log = CurveLog(updates=10, every=4)
    with pytest.raises(FloatingPointError, match="update 10"):
        log.record(9, {"loss": torch.tensor(torch.nan)})


def test_the_rate_falls_from_1_towards_0_along_half_a_cosine() -> None:
    rates = np.array([cosine(update, 1000) for update in range(1000)])
    assert rates[0] == 1
    assert rates[500] == pytest.approx(0.5)
    assert 0 < rates[-1] < 1e-5
    assert (np.diff(rates) < 0).all()
    np.testing.assert_allclose(rates, np.cos(np.arange(1000) / 1000 * np.pi / 2) ** 2, atol=1e-12)
