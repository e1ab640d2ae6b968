"""What is drawn of a sweep can be read."""

from itertools import pairwise
from typing import Any

import pytest

from sweeps.results.figures import history, slices
from sweeps.space import Dimension
from sweeps.spec import load_sweep
from tests.sweeps.tiny import tiny_sweep

ALPHA = "mb_stitch.alpha"


def trials(count: int, **fields: Any) -> list[dict[str, Any]]:
    return [
        {
            "trial": number, "fields": fields, "pruned": number % 3 == 1, "feasible": True,
            "gain": number / count, "gain_low": -0.1, "gain_high": 1.2,
        }
        for number in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize("count", [1, 9, 40])
def test_a_legend_lies_off_the_data(count: int) -> None:
    figure = history(tiny_sweep(), trials(count))
    figure.draw_without_rendering()
    (axes,), (legend,) = figure.axes, figure.legends
    assert axes.get_legend() is None
    assert not legend.get_window_extent().overlaps(axes.get_window_extent())


def test_ticks_of_a_searched_field_are_plain_numbers_side_by_side() -> None:
    """Of a range below two decades as well, where matplotlib labels the minor ticks, too."""
    space = {ALPHA: Dimension(low=2.0, high=40.0, log=True)}
    figure = slices(tiny_sweep(space=space), trials(4, **{ALPHA: 3.0}))
    figure.draw_without_rendering()
    (axes,) = figure.axes
    every = [*axes.get_xticklabels(), *axes.get_xticklabels(minor=True)]
    labels = [label for label in every if label.get_text()]
    assert {label.get_text() for label in labels} >= {"3", "10", "30"}
    low, high = axes.get_xlim()
    shown = [label for label in labels if low <= label.get_position()[0] <= high]
    boxes = [label.get_window_extent() for label in shown]
    assert not any(one.overlaps(two) for one, two in pairwise(boxes))


def test_equal_trials_show_no_rounding_errors() -> None:
    """A first sweep at smoke scale gains nothing anywhere."""
    space = {ALPHA: Dimension(low=2.0, high=40.0, log=True)}
    equal = [trial | {"gain": 1e-18} for trial in trials(4, **{ALPHA: 3.0})]
    (axes,) = slices(tiny_sweep(space=space), equal).axes
    assert axes.get_ylim() == pytest.approx((-0.05, 0.05))


def test_a_field_is_shown_over_the_range_that_was_searched() -> None:
    sweep = load_sweep("kitchen-data", "quick")
    one = trials(2, **{path: dimension.ends[0] for path, dimension in sweep.space.items()})
    figure = slices(sweep, [trial | {"misfit": 0.1} for trial in one])
    for axes, dimension in zip(figure.axes, sweep.space.values(), strict=True):
        low, high = axes.get_xlim()
        assert low < float(dimension.ends[0]) < float(dimension.ends[1]) < high
