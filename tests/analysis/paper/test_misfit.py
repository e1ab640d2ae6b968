"""How far profiles and scores are from the paper's."""

import numpy as np
import pandas as pd
import pytest

from analysis.paper.implied import FIRST, MEAN, SECOND, bounds
from analysis.paper.misfit import misfit, outside

CELLS = {("no-stitch", 2): 0.224, ("random-stitch", 2): 0.123}


def constructed(method: str = "no-stitch") -> pd.DataFrame:
    """Every rate in the middle of its range."""
    implied = bounds(method).rename(columns={"low": "implied_low", "high": "implied_high"})
    rate = (implied["implied_low"] + implied["implied_high"]) / 2
    return implied.assign(method=method, rate=rate)


def shifted(profile: pd.DataFrame, kind: str, skill: str, by: float) -> pd.DataFrame:
    """One rate moved to `by` above its range."""
    row = (profile["kind"] == kind) & (profile["skill"] == skill)
    return profile.assign(rate=profile["rate"].where(~row, profile["implied_high"] + by))


def test_inside_every_range_and_on_every_cell_nothing_is_off() -> None:
    found = misfit(constructed(), CELLS)
    assert (found.first, found.second, found.cells, found.total) == (0, 0, 0, 0)


def test_skills_weigh_alike_and_cells_are_added() -> None:
    profile = shifted(constructed(), FIRST, "light switch", 0.7)
    profile = shifted(profile, SECOND, "kettle", 0.35)
    found = misfit(profile, {("no-stitch", 2): 0.224, ("random-stitch", 2): 0.323})
    assert found.first == pytest.approx(0.1)
    assert found.second == pytest.approx(0.05)
    assert found.cells == pytest.approx(0.1)
    assert found.total == pytest.approx(0.075 + 0.1)


def test_means_and_other_methods_are_not_counted_again() -> None:
    profile = shifted(constructed(), FIRST, MEAN, 0.3)
    random = shifted(constructed("random-stitch"), SECOND, "kettle", 0.3)
    assert misfit(pd.concat([profile, random]), CELLS).total == 0


def test_below_a_range_counts_like_above_it() -> None:
    profile = constructed().assign(rate=lambda table: table["implied_low"] - 0.1)
    np.testing.assert_allclose(outside(profile)["outside"], 0.1)


@pytest.mark.parametrize("lacking", ["ranges", "skills"])
def test_nothing_to_compare_with_is_an_error(lacking: str) -> None:
    profile = constructed().assign(implied_low=np.nan, implied_high=np.nan)
    if lacking == "skills":
        profile = constructed().query("kind == @FIRST")
    with pytest.raises(ValueError, match="implies nothing"):
        misfit(profile, CELLS)
