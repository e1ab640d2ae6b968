from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.schema import RunSpec
from analysis.tables.table import GAIN_COLUMNS, SCORE_COLUMNS, Table, build_table


@pytest.fixture(scope="module")
def episodes(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    return episodes_from_segments(segments, spec)


@pytest.fixture(scope="module")
def table(episodes: pd.DataFrame, spec: RunSpec) -> Table:
    return build_table(episodes, spec, spec.tables[0])


def test_scores_are_means_beside_the_papers(table: Table, episodes: pd.DataFrame) -> None:
    assert table.scores.columns.tolist() == SCORE_COLUMNS
    assert len(table.scores) == 12
    last = table.scores.iloc[-1]
    ours = episodes.query("method == 'mb-stitch' and length == 4")
    assert last["score"] == pytest.approx(ours["score"].mean())
    by_seed = ours.groupby("seed")["score"].mean()
    assert last["variance"] == pytest.approx(by_seed.var(ddof=0))
    assert last["std"] == pytest.approx(by_seed.std(ddof=0))
    assert (last["paper_score"], last["paper_error"]) == (0.946, 0.001)
    assert (last["episodes"], last["seeds"]) == (24 * 3 * 10, 3)
    assert (table.scores["ci_low"] <= table.scores["score"]).all()
    assert (table.scores["score"] <= table.scores["ci_high"]).all()


def test_gains_are_of_the_last_method_over_each_other(table: Table, episodes: pd.DataFrame) -> None:
    assert table.gains.columns.tolist() == GAIN_COLUMNS
    assert len(table.gains) == 9
    assert set(table.gains["method"]) == {"mb-stitch"}
    gain = table.gains.iloc[0]
    means = episodes.query("length == 2").groupby("method")["score"].mean()
    assert gain["gain"] == pytest.approx(means["mb-stitch"] - means["no-stitch"])
    assert gain["relative_gain"] == pytest.approx(means["mb-stitch"] / means["no-stitch"] - 1)
    assert gain["pairs"] == 12 * 3 * 10


def test_gains_over_a_baseline(episodes: pd.DataFrame, spec: RunSpec) -> None:
    """Table 9 holds nine settings against No-Stitch."""
    entry = replace(spec.tables[0], baseline="no-stitch")
    gains = build_table(episodes, spec, entry).gains
    assert set(gains["baseline"]) == {"no-stitch"}
    assert set(gains["method"]) == {"random-stitch", "mf-stitch", "mb-stitch"}


def test_leads_hold_the_papers_leader_against_the_best_other(table: Table) -> None:
    assert table.leads["method"].tolist() == ["mb-stitch"] * 3
    for lead in table.leads.to_dict("records"):
        others = table.scores.query("row == @lead['row'] and method != 'mb-stitch'")
        assert lead["baseline"] == others.nlargest(1, "score")["method"].item()


def test_the_papers_leader_is_not_held_against_what_the_paper_has_not(
    episodes: pd.DataFrame, spec: RunSpec, table: Table
) -> None:
    """A method of ours that wins everywhere is no rival in a claim of the paper's."""
    ours = "mb-stitch[selective=true]"
    winning = episodes.query("method == 'mb-stitch'").assign(method=ours, score=1.0)
    more = replace(spec, methods={**spec.methods, ours: "MB-Stitch [selective=true]"})
    leads = build_table(pd.concat([episodes, winning]), more, spec.tables[0]).leads
    assert leads["baseline"].tolist() == table.leads["baseline"].tolist()


def test_missing_episodes_are_counted(episodes: pd.DataFrame, spec: RunSpec) -> None:
    short = episodes.query("not (method == 'mf-stitch' and length == 3 and episode > 7)")
    table = build_table(short, spec, spec.tables[0])
    assert table.missing == {("3 goals", "mf-stitch"): 24 * 3 * 2}
    pairs = table.gains.set_index(["row", "baseline"])["pairs"]
    assert pairs["3 goals", "mf-stitch"] == 24 * 3 * 8
    assert pairs["3 goals", "no-stitch"] == 24 * 3 * 10


def test_a_cell_without_episodes_is_empty(episodes: pd.DataFrame, spec: RunSpec) -> None:
    table = build_table(episodes.query("method != 'mb-stitch'"), spec, spec.tables[0])
    cells = table.scores.query("method == 'mb-stitch'")
    assert cells["score"].isna().all()
    assert cells["episodes"].tolist() == [0, 0, 0]
    assert np.isnan(table.gains["gain"]).all()


def test_grouping_by_last_skill_splits_the_same_episodes(
    table: Table, episodes: pd.DataFrame, spec: RunSpec
) -> None:
    """As in the paper, where Table 8's rows average to Table 2's cells."""
    by_last = build_table(episodes, spec, replace(spec.tables[0], rows="last_skill", paper=""))
    scores = by_last.scores
    assert scores["paper_score"].isna().all()
    pairs = scores[(scores["row"].str.count("→") == 1) & (scores["method"] == "mb-stitch")]
    assert pairs["score"].mean() == pytest.approx(table.scores.iloc[3]["score"])
