"""How often first and second skills succeed, beside what the paper's Table 8 implies for them."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from analysis.episodes import beginnings
from analysis.paper.implied import FIRST, MEAN, SECOND, averaged, bounds, known_methods
from analysis.run import Run
from analysis.schema import SEPARATOR, VARIANT, RunError, RunSpec
from analysis.statistics import arrange, estimate, generator, wilson

MARGIN = 0.1
"""A rate this close to what the paper's numbers allow is counted as inside."""

COLUMNS = [
    "method", "kind", "skill", "successes", "n", "rate", "ci_low", "ci_high",
    "implied_low", "implied_high", "inside",
]  # fmt: skip

PAPER_TABLES = {"2", "8"}
"""The paper's, whose episodes these bounds are of."""


def profiles(run: Run) -> pd.DataFrame | None:
    """COLUMNS for all methods of a run of such a table; None for other runs."""
    of_the_paper = PAPER_TABLES & {table.paper for table in run.spec.tables}
    if not of_the_paper or run.spec.parts:
        return None
    return pd.concat(
        [profile(run.segments, run.spec, method, run.quarantine) for method in run.spec.methods],
        ignore_index=True,
    )


def profile(
    segments: pd.DataFrame,
    spec: RunSpec,
    method: str,
    quarantine: Iterable[Mapping[str, Any]] = (),
) -> pd.DataFrame:
    """COLUMNS, one row for each first skill, each second skill by name, and the mean of either.

    method, as the spec names it.
    kind: "first": that a task's first skill succeeds. "second": that a task's first two skills
        succeed, averaged over what comes first; it is not conditional on the first.
    skill: its name in the spec, or "mean": over all first skills, or all pairs.
    successes, n: of episodes, over all seeds. What is shared with other methods counts for each.
    rate: every seed and every pair weighs the same.
    ci_low, ci_high: 95 %; of a single first skill Wilson's, else of `bootstrap_means`.
    implied_low, implied_high: what Table 8 allows for the paper's method of that kind; NaN where
        the paper has none, or where the run lacks some of the tasks that are averaged.
    inside: whether rate is at most MARGIN away from there; NA where that is not known.
    """
    if spec.parts:
        raise RunError(f"{spec.name} was merged from several runs: a profile is of one of them")
    if method not in spec.methods:
        raise RunError(f"{spec.name} has no method {method}; it has {', '.join(spec.methods)}")
    played = beginnings(segments, spec, method, quarantine)
    implied = _implied(method)
    rows = []
    for kind, length in ((FIRST, 1), (SECOND, 2)):
        of_kind = played[played["length"] == length]
        last = of_kind["task"].str.split(SEPARATOR).str[-1]
        for skill in (*spec.skills, MEAN):
            own = of_kind if skill == MEAN else of_kind[last == skill]
            if not own.empty:
                numbers = _rate(own, method, kind, skill)
                allowed = _allowed(own, spec, kind, skill, implied)
                rows.append((method, kind, skill, *numbers, *allowed))
    return _with_verdicts(pd.DataFrame(rows, columns=COLUMNS[:-1]))


def _with_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    # The comparison is one of decimals: 0.1 apart must not depend on binary rounding.
    near = table["rate"].between(
        table["implied_low"] - MARGIN - 1e-9, table["implied_high"] + MARGIN + 1e-9
    )
    return table.assign(inside=near.astype("boolean").where(table["implied_low"].notna()))


def _rate(
    own: pd.DataFrame, method: str, kind: str, skill: str
) -> tuple[int, int, float, float, float]:
    """successes, n, rate, ci_low, ci_high."""
    successes, n = int(own["success"].sum()), len(own)
    if kind == FIRST and skill != MEAN:
        low, high = wilson(np.array(successes), np.array(n))
        return successes, n, successes / n, float(low), float(high)
    rng = generator("profile", method, kind, skill)
    ours = estimate(arrange(own, "success"), rng)
    return successes, n, ours.mean, ours.low, ours.high


def _implied(method: str) -> dict[tuple[str, str], tuple[float, float]]:
    """(kind, skill) → bounds; none where the paper's Table 8 does not have such a method."""
    kind_of_method = method.partition(VARIANT)[0].partition("[")[0]
    if kind_of_method not in known_methods():
        return {}
    rows = bounds(kind_of_method).itertuples(index=False)
    return {(kind, skill): (low, high) for kind, skill, low, high in rows}


def _allowed(
    own: pd.DataFrame,
    spec: RunSpec,
    kind: str,
    skill: str,
    implied: Mapping[tuple[str, str], tuple[float, float]],
) -> tuple[float, float]:
    """implied_low, implied_high of a row."""
    label = skill if skill == MEAN else spec.skill_label(skill)
    tasks = {tuple(map(spec.skill_label, task.split(SEPARATOR))) for task in own["task"].unique()}
    if (kind, label) not in implied or tasks != set(averaged(kind, label)):
        return np.nan, np.nan
    return implied[kind, label]
