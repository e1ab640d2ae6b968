"""First and second skills of a run beside what the paper implies for them."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pandas as pd
import pytest

from analysis.paper.implied import MEAN, bounds, skills
from analysis.paper.profile import COLUMNS, profile
from analysis.schema import RunError, RunSpec
from tests.rows import row

SKILLS = tuple(skills())
MICROWAVE, KETTLE = "microwave", "kettle"
SPEC = RunSpec(
    name="table2",
    title="Kitchen",
    benchmark="kitchen",
    scale="smoke",
    skills=SKILLS,
    methods={"no-stitch": "No-Stitch", "mb-stitch[alpha=1]": "MB-Stitch"},
    seeds=(0, 1),
    episodes=4,
    tasks=tuple(">".join(task) for task in permutations(SKILLS, 3)),
    step_limits={3: 360},
    tables=(),
    own_first_skill=frozenset({"mb-stitch[alpha=1]"}),
)


def play(method: str, firsts: str) -> list[tuple[object, ...]]:
    """The microwave works in three of four episodes, the kettle in two of them after it."""
    rows: list[tuple[object, ...]] = []
    for seed in SPEC.seeds:
        for episode in range(SPEC.episodes):
            for first in SKILLS:
                opened = first == MICROWAVE and episode < 3
                rows.append((seed, firsts, first, 1, episode, opened, 60))
                for second in SKILLS if opened else ():
                    if second != first:
                        works = second == KETTLE and episode < 2
                        prefix = f"{first}>{second}"
                        rows.append((seed, method, prefix, 2, episode, works, 120))
    return rows


@pytest.fixture(scope="module")
def segments() -> pd.DataFrame:
    rows = play("no-stitch", "") + play("mb-stitch[alpha=1]", "mb-stitch[alpha=1]")
    columns = ["seed", "method", "prefix", "depth", "episode", "success", "end_step"]
    return pd.DataFrame(rows, columns=columns)


def by_skill(table: pd.DataFrame) -> pd.DataFrame:
    return table.set_index(["kind", "skill"])


@pytest.mark.parametrize("method", SPEC.methods)
def test_rates_are_of_all_episodes(segments: pd.DataFrame, method: str) -> None:
    table = profile(segments, SPEC, method)
    assert list(table.columns) == COLUMNS
    assert len(table) == 2 * (len(SKILLS) + 1)
    rows = by_skill(table)
    assert row(rows, "first", MICROWAVE)[["successes", "n", "rate"]].tolist() == [6, 8, 0.75]
    assert rows.loc[("first", MEAN), "rate"] == pytest.approx(0.75 / 7)
    kettle = row(rows, "second", KETTLE)
    assert kettle[["successes", "n"]].tolist() == [4, 48]
    assert kettle["rate"] == pytest.approx(0.5 / 6)  # and not 2/3, as once the first succeeded
    assert rows.loc[("second", MEAN), "rate"] == pytest.approx(0.5 / 42)
    assert table["rate"].between(table["ci_low"], table["ci_high"]).all()


@pytest.mark.parametrize(
    ("method", "paper"), [("no-stitch", "no-stitch"), ("mb-stitch[alpha=1]", "mb-stitch")]
)
def test_bounds_are_the_paper_s_method_s(segments: pd.DataFrame, method: str, paper: str) -> None:
    table = profile(segments, SPEC, method)
    expected = bounds(paper)[["low", "high"]].to_numpy()
    np.testing.assert_array_equal(table[["implied_low", "implied_high"]].to_numpy(), expected)
    rows = by_skill(table)
    assert rows.loc[("first", MICROWAVE), "inside"]  # 0.75, and the paper's is above 0.6
    assert not rows.loc[("first", "bottom burner"), "inside"]  # 0, and above 0.2 at least


def test_where_tasks_are_missing_the_bounds_are_of_something_else(segments: pd.DataFrame) -> None:
    few = replace(SPEC, tasks=(f"{MICROWAVE}>{KETTLE}", f"{KETTLE}>{MICROWAVE}"))
    rows = by_skill(profile(segments, few, "no-stitch"))
    assert rows.loc[("second", KETTLE), "rate"] == 0.5
    assert rows["implied_low"].notna().tolist() == [True, True, False, False, False, False]
    assert pd.isna(row(rows, "second", KETTLE)["inside"])


def test_what_was_given_up_is_left_out(segments: pd.DataFrame) -> None:
    lost = {"seed": 1, "method": "no-stitch", "prefix": f"{MICROWAVE}>{KETTLE}",
            "episodes": [0, 1, 2, 3], "error": ""}  # fmt: skip
    rows = by_skill(profile(segments, SPEC, "no-stitch", [lost]))
    assert row(rows, "second", KETTLE)[["successes", "n"]].tolist() == [2, 44]


def test_a_method_that_table_8_has_not(segments: pd.DataFrame) -> None:
    renamed = segments.replace({"method": {"mb-stitch[alpha=1]": "single-policy"}})
    own = frozenset({"single-policy"})
    spec = replace(SPEC, methods={"single-policy": "Single-Policy"}, own_first_skill=own)
    table = profile(renamed, spec, "single-policy")
    assert table["rate"].notna().all()
    assert table[["implied_low", "implied_high", "inside"]].isna().all(axis=None)
    with pytest.raises(RunError, match="no method no-stitch"):
        profile(renamed, spec, "no-stitch")
