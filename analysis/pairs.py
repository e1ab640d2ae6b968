"""Ordered pairs of skills: those shown together in the data, and those never seen in a row."""

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from analysis.run import SEPARATOR, RunSpec
from analysis.statistics import arrange, estimate, generator, paired_gain

BASELINE = "no-stitch"
IN_DATA, OTHER, ALL = "pairs in the data", "other pairs", "all pairs"

Orders = list[list[str]]


def shown_orders(datasets: Iterable[Mapping[str, Any]]) -> Orders | None:
    """The orders of skills that demonstrations show; None where the datasets do not say."""
    told = [dataset["orders"] for dataset in datasets if "orders" in dataset]
    return [order for orders in told for order in orders] if told else None


def shown_pairs(orders: Orders) -> set[tuple[str, str]]:
    """(first, second) of every two skills that follow one another in some demonstration."""
    return {pair for order in orders for pair in pairwise(order)}


def second_skills(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    """One row for every second skill that was played: its first skill had succeeded.

    Columns seed, method, task ("first>second"), first, second, episode, success (within the step
    limit of two skills), value_start, and length and accomplished, of the second skill alone.
    """
    limit = spec.step_limits.get(2, np.inf)
    seconds = segments[(segments["depth"] == 2) & segments["method"].isin(list(spec.methods))]
    parts = [prefix.split(SEPARATOR) for prefix in seconds["prefix"]]
    success = seconds["success"].astype(bool) & (seconds["end_step"] <= limit)
    return pd.DataFrame(
        {
            "seed": seconds["seed"],
            "method": seconds["method"],
            "task": seconds["prefix"],
            "first": [first for first, _ in parts],
            "second": [second for _, second in parts],
            "episode": seconds["episode"],
            "success": success,
            "value_start": seconds["value_start"],
            "length": 1,
            "accomplished": success.astype(int),
        }
    )


def pair_table(seconds: pd.DataFrame, orders: Orders, spec: RunSpec) -> pd.DataFrame:
    """Columns first, second, in_data, method, successes, trials, rate; in the spec's order."""
    shown = shown_pairs(orders)
    grouped = seconds.groupby(["first", "second", "method"])["success"]
    counts = {pair: (int(part.sum()), len(part)) for pair, part in grouped}
    records = [
        (first, second, (first, second) in shown, method, *counts[first, second, method])
        for first in spec.skills
        for second in spec.skills
        for method in spec.methods
        if (first, second, method) in counts
    ]
    columns = ["first", "second", "in_data", "method", "successes", "trials"]
    table = pd.DataFrame(records, columns=columns)
    return table.assign(rate=table["successes"] / table["trials"])


def pair_groups(seconds: pd.DataFrame, orders: Orders, spec: RunSpec) -> pd.DataFrame:
    """How often second skills succeed, by group of pairs and method.

    Columns group, method, pairs, successes, trials, rate, ci_low, ci_high, gain, gain_low,
    gain_high, seeds. In rates and gains every pair weighs the same, and every seed. The gain is
    over No-Stitch, paired over the episodes both played; intervals are of 95 % and take
    the pairs as fixed (see `analysis.statistics.bootstrap_means`).
    """
    shown = shown_pairs(orders)
    known = np.array(
        [pair in shown for pair in zip(seconds["first"], seconds["second"], strict=True)], bool
    )
    records = []
    for group, chosen in {IN_DATA: known, OTHER: ~known, ALL: known | ~known}.items():
        members = seconds[chosen]
        for method in spec.methods:
            part = members[members["method"] == method]
            if not part.empty:
                records.append((group, method, *_group_numbers(part, members, group, method)))
    columns = [
        "group", "method", "pairs", "successes", "trials", "rate", "ci_low", "ci_high",
        "gain", "gain_low", "gain_high", "seeds",
    ]  # fmt: skip
    return pd.DataFrame(records, columns=columns)


def _group_numbers(
    part: pd.DataFrame, members: pd.DataFrame, group: str, method: str
) -> tuple[float, ...]:
    rate = estimate(arrange(part, "accomplished"), generator("pairs", group, method))
    others = members[members["method"] == (BASELINE if method != BASELINE else None)]
    gain = paired_gain(part, others, generator("pairs gain", group, method))
    return (
        part["task"].nunique(), int(part["success"].sum()), len(part), rate.mean, rate.low,
        rate.high, gain.difference, gain.low, gain.high, rate.seeds,
    )  # fmt: skip
