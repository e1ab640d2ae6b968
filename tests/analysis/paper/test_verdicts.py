from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.paper.verdicts import (
    AGREES,
    EXPLANATION,
    FAILS,
    HIGHER,
    HOLDS,
    LOWER,
    NO_DATA,
    NOT_JUDGED,
    NOT_PRINTED,
    ONE_SEED_EXPLANATION,
    SAME_SKILLS,
    SMOKE,
    SMOKE_EXPLANATION,
    UNDECIDED,
    cell_verdict,
    cell_verdicts,
    claims,
    error_reading,
    explanation,
)
from analysis.schema import RunSpec
from analysis.tables.table import Table, build_table


@pytest.mark.parametrize(
    ("score", "low", "high", "paper", "verdict"),
    [
        (0.50, 0.30, 0.70, 0.31, AGREES),
        (0.50, 0.49, 0.51, 0.55, AGREES),
        (0.50, 0.49, 0.51, 0.551, LOWER),
        (0.50, 0.49, 0.51, 0.40, HIGHER),
        (np.nan, np.nan, np.nan, 0.40, NO_DATA),
        (0.50, 0.49, 0.51, np.nan, NOT_PRINTED),
    ],
)
def test_cell_verdicts(score: float, low: float, high: float, paper: float, verdict: str) -> None:
    assert cell_verdict(score, low, high, paper) == verdict


@pytest.fixture(scope="module")
def table(segments: pd.DataFrame, spec: RunSpec) -> Table:
    return build_table(episodes_from_segments(segments, spec), spec, spec.tables[0])


def test_claims_of_table_1(table: Table) -> None:
    found = claims(table)
    assert [claim.verdict for claim in found] == [HOLDS] * 4
    assert found[0].text == "MB-Stitch leads “2 goals”"
    assert "3 seeds, 360 paired episodes" in found[0].detail
    assert found[3].text.startswith("No-Stitch accomplishes the same number of skills")


@pytest.mark.parametrize(
    ("low", "high", "verdict"), [(-0.1, 0.1, UNDECIDED), (-0.2, -0.1, FAILS), (0.1, 0.2, HOLDS)]
)
def test_a_lead_is_judged_by_its_interval(
    table: Table, low: float, high: float, verdict: str
) -> None:
    leads = table.leads[:1].assign(ci_low=low, ci_high=high)
    assert claims(replace(table, leads=leads))[0].verdict == verdict


def test_a_verdict_from_one_seed_is_of_its_models_alone(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    alone = replace(spec, seeds=(0,))
    one = build_table(episodes_from_segments(segments, alone), alone, alone.tables[0])
    found = claims(one)
    assert [claim.judgement for claim in found] == ["holds for these models"] * 4
    undecided = one.leads.assign(ci_low=-0.1, ci_high=0.1)
    assert claims(replace(one, leads=undecided))[0].judgement == UNDECIDED
    assert explanation(one) == f"{EXPLANATION} {ONE_SEED_EXPLANATION}"


def test_a_verdict_from_several_seeds_is_said_as_it_is(table: Table) -> None:
    assert [claim.judgement for claim in claims(table)] == [HOLDS] * 4
    assert explanation(table) == EXPLANATION


def test_a_smoke_run_is_not_judged(table: Table) -> None:
    smoke = replace(table, spec=replace(table.spec, scale=SMOKE))
    assert set(cell_verdicts(smoke)) == {NOT_JUDGED}
    assert claims(smoke) == []
    assert explanation(smoke) == SMOKE_EXPLANATION
    assert error_reading(smoke) == ""


def test_rows_of_other_tasks_make_no_claim(segments: pd.DataFrame, spec: RunSpec) -> None:
    """One task of twelve is not the paper's "2 goals"; the other rows are as they were."""
    few = replace(spec, tasks=tuple(t for t in spec.tasks if t.count(">") != 1 or t == "g0>g1"))
    table = build_table(episodes_from_segments(segments, few), few, few.tables[0])
    verdicts = dict(zip(table.scores["row"], cell_verdicts(table), strict=True))
    assert verdicts["2 goals"] == NOT_PRINTED
    assert verdicts["3 goals"] in (AGREES, HIGHER, LOWER)
    alone = replace(table, scores=table.scores.assign(paper_score=np.nan), leads=table.leads[:0])
    assert claims(alone) == []
    texts = [claim.text for claim in claims(table)]
    assert not any("2 goals" in text for text in texts)
    assert any("3 goals" in text for text in texts)


def test_constant_skills_fail_when_they_grow(table: Table) -> None:
    scores = table.scores.copy()
    scores.loc[scores["method"] == "no-stitch", "score"] = 0.5
    assert claims(replace(table, scores=scores))[-1].verdict == FAILS


def test_the_claim_judged_without_an_interval_is_named() -> None:
    assert (
        f"without an interval: it “{HOLDS}” if our numbers lie within {SAME_SKILLS}" in EXPLANATION
    )


def test_table_2_does_not_claim_constant_skills(table: Table) -> None:
    """The paper's No-Stitch goes from 0.448 to 0.500 accomplished skills there."""
    kitchen = replace(table, entry=replace(table.entry, paper="2"))
    assert not any("same number" in claim.text for claim in claims(kitchen))


def test_reading_of_the_papers_error(table: Table) -> None:
    scores = pd.DataFrame(
        {"score": 0.5, "variance": [0.0004, 0.0001], "std": [0.02, 0.01], "seeds": 3,
         "paper_error": [0.0, 0.0]}
    )  # fmt: skip

    def reading(scores: pd.DataFrame) -> str:
        return error_reading(replace(table, scores=scores))

    assert "variance over seeds in 2 of 2 cells" in reading(scores)
    assert "the variance better" in reading(scores)
    assert "One seed" in reading(scores.assign(seeds=1))
    assert reading(scores.assign(paper_error=np.nan)) == ""
