"""Ordered pairs of skills: those shown together in the data, and those never seen in a row."""

from collections.abc import Hashable, Iterable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from analysis.episodes import beginnings
from analysis.schema import SEPARATOR, RunSpec
from analysis.statistics import Estimate, Gain, arrange, estimate, generator, paired_gain

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


def both_skills(
    segments: pd.DataFrame, spec: RunSpec, quarantine: Iterable[Mapping[str, Any]] = ()
) -> pd.DataFrame:
    """One row for every episode of a pair of skills, whether or not the first one succeeded.

    Columns seed, method, task, first, second, episode, length, accomplished: 1 where both
    succeeded, of 1. Methods with first skills of their own are compared by these.
    """
    played = pd.concat(
        [beginnings(segments, spec, method, quarantine) for method in spec.methods],
        ignore_index=True,
    )
    pairs = played[played["length"] == 2]
    skills = pairs["task"].str.split(SEPARATOR)
    return pairs[["seed", "method", "task", "episode"]].assign(
        first=skills.str[0],
        second=skills.str[-1],
        length=1,
        accomplished=pairs["success"].astype(int),
    )


def pair_counts(seconds: pd.DataFrame) -> dict[tuple[Hashable, ...], tuple[int, int]]:
    """Successes and trials of second skills by (first, second, method)."""
    played = seconds.groupby(["first", "second", "method"])["success"]
    return {pair: (int(part.sum()), len(part)) for pair, part in played}


def pair_table(
    seconds: pd.DataFrame, both: pd.DataFrame, orders: Orders, spec: RunSpec
) -> pd.DataFrame:
    """Columns first, second, in_data, method, successes, trials, rate, episodes, both.

    rate: of the second skill once the first has succeeded; both: of both, over all episodes. In
    the spec's order.
    """
    shown = shown_pairs(orders)
    key = ["first", "second", "method"]
    counts = pair_counts(seconds)
    wholes = {pair: (len(part), part.mean()) for pair, part in both.groupby(key)["accomplished"]}
    unknown = 0, np.nan
    records = [
        (first, second, (first, second) in shown, method, *counts[first, second, method])
        for first in spec.skills
        for second in spec.skills
        for method in spec.methods
        if (first, second, method) in counts
    ]
    columns = ["first", "second", "in_data", "method", "successes", "trials"]
    table = pd.DataFrame(records, columns=columns)
    table["rate"] = table["successes"] / table["trials"]
    known = [wholes.get(pair, unknown) for pair in table[key].itertuples(index=False, name=None)]
    table[["episodes", "both"]] = pd.DataFrame(known, columns=["episodes", "both"])
    return table


def pair_groups(
    seconds: pd.DataFrame, both: pd.DataFrame, orders: Orders, spec: RunSpec
) -> pd.DataFrame:
    """How often second skills succeed, by group of pairs and method.

    Columns group, method, pairs, successes, trials, rate, ci_low, ci_high, gain, gain_low,
    gain_high, seeds: of second skills once the first has succeeded. The gain is over No-Stitch,
    paired over the second skills that both played: those whose first skill, each method's own,
    succeeded under both. Then both, both_low, both_high, both_gain, both_gain_low, both_gain_high:
    that both skills succeed, over all episodes. In rates and gains every pair weighs the same, and
    every seed; intervals are of 95 % and take the pairs as fixed (see
    `analysis.statistics.bootstrap_means`).
    """
    shown = shown_pairs(orders)
    records = []
    for group in (IN_DATA, OTHER, ALL):
        members, wholes = (_of_group(frame, group, shown) for frame in (seconds, both))
        for method in spec.methods:
            part = members[members["method"] == method]
            if part.empty:
                continue
            ours, gain = _numbers(members, method, "pairs", group)
            whole, whole_gain = _numbers(wholes, method, "both skills of pairs", group)
            records.append(
                (group, method, part["task"].nunique(), int(part["success"].sum()), len(part),
                 ours.mean, ours.low, ours.high, gain.difference, gain.low, gain.high, ours.seeds,
                 whole.mean, whole.low, whole.high, whole_gain.difference, whole_gain.low,
                 whole_gain.high)
            )  # fmt: skip
    columns = [
        "group", "method", "pairs", "successes", "trials", "rate", "ci_low", "ci_high",
        "gain", "gain_low", "gain_high", "seeds",
        "both", "both_low", "both_high", "both_gain", "both_gain_low", "both_gain_high",
    ]  # fmt: skip
    return pd.DataFrame(records, columns=columns)


def _of_group(frame: pd.DataFrame, group: str, shown: set[tuple[str, str]]) -> pd.DataFrame:
    pairs = zip(frame["first"], frame["second"], strict=True)
    known = np.array([pair in shown for pair in pairs], bool)
    return frame[{IN_DATA: known, OTHER: ~known, ALL: known | ~known}[group]]


def _numbers(members: pd.DataFrame, method: str, what: str, group: str) -> tuple[Estimate, Gain]:
    """The mean of what a method accomplished, and its gain over the baseline."""
    part = members[members["method"] == method]
    rate = estimate(arrange(part, "accomplished"), generator(what, group, method))
    others = members[members["method"] == (BASELINE if method != BASELINE else None)]
    return rate, paired_gain(part, others, generator(f"{what} gain", group, method))
