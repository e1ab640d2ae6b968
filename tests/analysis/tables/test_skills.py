import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.schema import RunSpec
from analysis.tables.skills import permutation_scores, single_skill_rates


def test_single_skills(segments: pd.DataFrame, spec: RunSpec) -> None:
    rates = single_skill_rates(segments, spec)
    assert rates["skill"].tolist() == ["g0", "g1", "g2", "g3"]
    assert rates["trials"].tolist() == [30] * 4
    assert rates["rate"].tolist() == [1.0] * 4
    assert (rates["low"] < 1).all()


def test_every_permutation_of_every_method(segments: pd.DataFrame, spec: RunSpec) -> None:
    episodes = episodes_from_segments(segments, spec)
    scores = permutation_scores(episodes, spec)
    assert len(scores) == 60 * 4
    row = scores.query("task == 'g1>g3' and method == 'mb-stitch'").iloc[0]
    part = episodes.query("task == 'g1>g3' and method == 'mb-stitch'")
    assert row["score"] == pytest.approx(part["score"].mean())
    assert row["complete"] == pytest.approx((part["accomplished"] == 2).mean())
    assert (row["episodes"], row["seeds"]) == (30, 3)
