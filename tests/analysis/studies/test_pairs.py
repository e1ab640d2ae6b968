from dataclasses import replace

import pandas as pd
import pytest

from analysis.schema import RunSpec
from analysis.studies.pairs import (
    ALL,
    IN_DATA,
    OTHER,
    both_skills,
    pair_groups,
    pair_table,
    second_skills,
    shown_orders,
    shown_pairs,
)
from tests.analysis.kitchen_run import kitchen_spec
from tests.rows import row

ORDERS = [["microwave", "kettle", "light switch"]]


@pytest.fixture(scope="module")
def kitchen() -> RunSpec:
    pairs = ("microwave>kettle", "kettle>microwave")
    return replace(RunSpec.from_dict(kitchen_spec()), seeds=(0,), tasks=pairs)


@pytest.fixture(scope="module")
def segments() -> pd.DataFrame:
    """By hand: the microwave opens in 4 of 4 episodes, the kettle moves in 2 of them.

    Of a pair in the data 3 of 4 succeed without a stitch and 4 of 4 with one, of another pair 1 of
    2 and 2 of 2, the last one of them too late.
    """
    outcomes = {
        ("no-stitch", "microwave>kettle"): [True, True, True, False],
        ("mb-stitch", "microwave>kettle"): [True, True, True, True],
        ("no-stitch", "kettle>microwave"): [True, False],
        ("mb-stitch", "kettle>microwave"): [True, True],
    }
    rows = [
        (0, method, prefix, 2, episode, success, 0.0, 251 if prefix[0] == "k" and episode else 99)
        for (method, prefix), successes in outcomes.items()
        for episode, success in enumerate(successes)
    ]
    rows += [(0, "", "microwave", 1, episode, True, 0.0, 60) for episode in range(4)]
    rows += [(0, "", "kettle", 1, episode, episode < 2, 0.0, 60) for episode in range(4)]
    columns = [
        "seed", "method", "prefix", "depth", "episode", "success", "value_start", "end_step"
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=columns)


@pytest.fixture(scope="module")
def seconds(segments: pd.DataFrame, kitchen: RunSpec) -> pd.DataFrame:
    return second_skills(segments, kitchen)


@pytest.fixture(scope="module")
def both(segments: pd.DataFrame, kitchen: RunSpec) -> pd.DataFrame:
    return both_skills(segments, kitchen)


def test_orders_are_gathered_and_their_absence_is_told_apart() -> None:
    datasets = [{"name": "a", "orders": [["x", "y"]]}, {"name": "b", "orders": [["y", "z"], ["x"]]}]
    assert shown_orders(datasets) == [["x", "y"], ["y", "z"], ["x"]]
    assert shown_orders([{"name": "maze"}]) is None
    assert shown_orders([{"name": "single", "orders": []}]) == []


def test_only_neighbours_in_this_order_are_a_pair() -> None:
    assert shown_pairs(ORDERS) == {("microwave", "kettle"), ("kettle", "light switch")}


def test_pairs_are_counted_within_the_step_limit(
    seconds: pd.DataFrame, both: pd.DataFrame, kitchen: RunSpec
) -> None:
    table = pair_table(seconds, both, ORDERS, kitchen)
    assert table[["first", "in_data", "method", "successes", "trials", "rate"]].values.tolist() == [
        ["microwave", True, "no-stitch", 3, 4, 0.75],
        ["microwave", True, "mb-stitch", 4, 4, 1.0],
        ["kettle", False, "no-stitch", 1, 2, 0.5],
        ["kettle", False, "mb-stitch", 1, 2, 0.5],
    ]
    assert table["episodes"].tolist() == [4] * 4
    assert table["both"].tolist() == [0.75, 1.0, 0.25, 0.25]


def test_groups_weigh_every_pair_the_same(
    seconds: pd.DataFrame, both: pd.DataFrame, kitchen: RunSpec
) -> None:
    groups = pair_groups(seconds, both, ORDERS, kitchen).set_index(["group", "method"])
    counts = groups[["pairs", "successes", "trials"]]
    assert row(counts, IN_DATA, "no-stitch").tolist() == [1, 3, 4]
    assert row(counts, OTHER, "mb-stitch").tolist() == [1, 1, 2]
    assert row(counts, ALL, "no-stitch").tolist() == [2, 4, 6]
    assert groups.loc[(ALL, "no-stitch"), "rate"] == pytest.approx((0.75 + 0.5) / 2)
    assert groups.loc[(IN_DATA, "mb-stitch"), "gain"] == pytest.approx(0.25)
    assert groups.loc[(ALL, "mb-stitch"), "gain"] == pytest.approx(0.125)
    assert groups.loc[(ALL, "no-stitch"), "both"] == pytest.approx((0.75 + 0.25) / 2)
    assert groups.loc[(ALL, "mb-stitch"), "both_gain"] == pytest.approx(0.125)
    assert groups.xs("no-stitch", level="method")["gain"].isna().all()
    assert (groups["ci_low"] <= groups["rate"]).all()
    assert (groups["rate"] <= groups["ci_high"]).all()


def test_what_first_skills_of_its_own_are_worth(segments: pd.DataFrame, kitchen: RunSpec) -> None:
    """A stitch moves the kettle in two more episodes, in which the microwave then opens, too.

    No-Stitch does not come to these second skills, so its own gain is nothing.
    """
    firsts = segments[segments["depth"] == 1].assign(method="mb-stitch", success=True)
    later = segments[segments["prefix"].eq("kettle>microwave") & segments["episode"].eq(0)]
    later = later[later["method"] == "mb-stitch"]
    more = [later.assign(episode=episode) for episode in (2, 3)]
    segments = pd.concat([segments, firsts, *more], ignore_index=True)
    kitchen = replace(kitchen, own_first_skill=frozenset({"mb-stitch"}))
    seconds, both = second_skills(segments, kitchen), both_skills(segments, kitchen)
    groups = pair_groups(seconds, both, ORDERS, kitchen).set_index(["group", "method"])
    others = row(groups, OTHER, "mb-stitch")
    assert (others["successes"], others["trials"], others["gain"]) == (3, 4, 0)
    assert (others["both"], others["both_gain"]) == (0.75, 0.5)


def test_a_group_without_pairs_is_left_out(
    seconds: pd.DataFrame, both: pd.DataFrame, kitchen: RunSpec
) -> None:
    assert set(pair_groups(seconds, both, [], kitchen)["group"]) == {OTHER, ALL}
