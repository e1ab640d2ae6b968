import pandas as pd
import pytest

from analysis.pairs import (
    ALL,
    IN_DATA,
    OTHER,
    pair_groups,
    pair_table,
    second_skills,
    shown_orders,
    shown_pairs,
)
from analysis.run import RunSpec
from tests.analysis.kitchen_run import kitchen_spec

ORDERS = [["microwave", "kettle", "light switch"]]


@pytest.fixture(scope="module")
def kitchen() -> RunSpec:
    return RunSpec.from_dict(kitchen_spec())


@pytest.fixture(scope="module")
def seconds(kitchen: RunSpec) -> pd.DataFrame:
    """By hand: of a pair in the data 3 of 4 succeed without a stitch and 4 of 4 with one, of
    another pair 1 of 2 and 2 of 2, the last one of them too late.
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
    rows.append((0, "", "kettle", 1, 0, True, 0.0, 60))
    columns = [
        "seed", "method", "prefix", "depth", "episode", "success", "value_start", "end_step"
    ]  # fmt: skip
    return second_skills(pd.DataFrame(rows, columns=columns), kitchen)


def test_orders_are_gathered_and_their_absence_is_told_apart() -> None:
    datasets = [{"name": "a", "orders": [["x", "y"]]}, {"name": "b", "orders": [["y", "z"], ["x"]]}]
    assert shown_orders(datasets) == [["x", "y"], ["y", "z"], ["x"]]
    assert shown_orders([{"name": "maze"}]) is None
    assert shown_orders([{"name": "single", "orders": []}]) == []


def test_only_neighbours_in_this_order_are_a_pair() -> None:
    assert shown_pairs(ORDERS) == {("microwave", "kettle"), ("kettle", "light switch")}


def test_pairs_are_counted_within_the_step_limit(seconds: pd.DataFrame, kitchen: RunSpec) -> None:
    table = pair_table(seconds, ORDERS, kitchen)
    assert table[["first", "in_data", "method", "successes", "trials", "rate"]].values.tolist() == [
        ["microwave", True, "no-stitch", 3, 4, 0.75],
        ["microwave", True, "mb-stitch", 4, 4, 1.0],
        ["kettle", False, "no-stitch", 1, 2, 0.5],
        ["kettle", False, "mb-stitch", 1, 2, 0.5],
    ]


def test_groups_weigh_every_pair_the_same(seconds: pd.DataFrame, kitchen: RunSpec) -> None:
    groups = pair_groups(seconds, ORDERS, kitchen).set_index(["group", "method"])
    counts = groups[["pairs", "successes", "trials"]]
    assert counts.loc[(IN_DATA, "no-stitch")].tolist() == [1, 3, 4]
    assert counts.loc[(OTHER, "mb-stitch")].tolist() == [1, 1, 2]
    assert counts.loc[(ALL, "no-stitch")].tolist() == [2, 4, 6]
    assert groups.loc[(ALL, "no-stitch"), "rate"] == pytest.approx((0.75 + 0.5) / 2)
    assert groups.loc[(IN_DATA, "mb-stitch"), "gain"] == pytest.approx(0.25)
    assert groups.loc[(ALL, "mb-stitch"), "gain"] == pytest.approx(0.125)
    assert groups.xs("no-stitch", level="method")["gain"].isna().all()
    assert (groups["ci_low"] <= groups["rate"]).all()
    assert (groups["rate"] <= groups["ci_high"]).all()


def test_a_group_without_pairs_is_left_out(seconds: pd.DataFrame, kitchen: RunSpec) -> None:
    assert set(pair_groups(seconds, [], kitchen)["group"]) == {OTHER, ALL}
