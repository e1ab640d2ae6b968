"""What there is to stitch: each skill's rate from its own starts and from where others end.

Beside it the two variances of Eq. 2, for β means something only beside the scale of the values.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
import pandas as pd

from analysis.run import Run
from analysis.schema import SEPARATOR, VARIANT, RunSpec
from analysis.statistics import wilson
from analysis.studies.pairs import BASELINE, second_skills
from analysis.tables.writers import Record

COLUMNS = [
    "part", "skill", "own_successes", "own_trials", "own_rate", "own_low", "own_high",
    "after_successes", "after_trials", "after_rate", "after_low", "after_high", "value_spread",
    "dynamics_spread", "beta", "beta_scaled",
]  # fmt: skip
COUNTS = ["own_successes", "own_trials", "after_successes", "after_trials"]

HEADER = [
    "Data", "Skill", "From its own starts", "After another skill", "Var(V)", "Var(T)", "β",
    "β · Var(V) / Var(T)",
]  # fmt: skip
NOTE = (
    "Successes of trials without stitching, with Wilson's 95 % interval. Own starts are where "
    "held-out demonstrations of the skill begin (in Kitchen of those that succeeded, in robosuite "
    "of all), played by the first seed's models for at most the steps of the longest task; after "
    "another skill means where that one succeeded, over all seeds, with the steps that it left. A "
    "skill's own limit, where the run has one, holds for both. Var(V) and Var(T) are the two "
    "variances of Eq. 2, means over the skill's held-out demonstrations as a planner has them, "
    "first seed. In place of β the last column would make the price of Var(T) as large as "
    "β · Var(V), which is β / α times the other price, α · Var(V): both prices are equal where "
    "α = β."
)


def rate_table(run: Run) -> pd.DataFrame:
    """COLUMNS, one row a part and skill with a diagnosis; NaN or 0 trials where unknown."""
    labels = [part.label for part in run.spec.parts] or [""]
    rows = [
        row
        for label, spec in zip(labels, run.spec.by_part, strict=True)
        if label in run.diagnoses
        for row in _rows(run, label, spec)
    ]
    return pd.DataFrame(rows, columns=COLUMNS).astype(dict.fromkeys(COUNTS, "Int64"))


def _rows(run: Run, label: str, spec: RunSpec) -> Iterator[Record]:
    study = run.diagnoses[label]
    after = _after_another(run.segments, spec)
    for skill in run.spec.skills:
        if skill not in study["competence"]:
            continue
        own, met = study["competence"][skill], after[after["second"] == skill]
        price = study.get("prices", {}).get(skill, {})
        values, states = (price.get(f"{of}_spread", math.nan) for of in ("value", "dynamics"))
        beta = run.stitches.get(label, {}).get("beta", math.nan)
        yield {
            "part": label,
            "skill": run.spec.skill_label(skill),
            **_rate("own", own["successes"], own["trials"]),
            **_rate("after", int(met["success"].sum()), len(met)),
            "value_spread": values,
            "dynamics_spread": states,
            "beta": beta,
            "beta_scaled": beta * values / states if states else math.nan,
        }


def _after_another(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    """Second skills of a part's tasks, nothing in between."""
    seconds = second_skills(segments, spec)
    plain = [method.split(VARIANT)[0] == BASELINE for method in seconds["method"]]
    pairs = {SEPARATOR.join(task.split(SEPARATOR)[:2]) for task in spec.tasks}
    return seconds[np.array(plain, dtype=bool) & seconds["task"].isin(pairs)]


def _rate(name: str, successes: int, trials: int) -> dict[Hashable, Any]:
    low, high = wilson(np.array(successes), np.array(trials))
    return {
        f"{name}_successes": successes,
        f"{name}_trials": trials,
        f"{name}_rate": successes / trials if trials else math.nan,
        f"{name}_low": float(low),
        f"{name}_high": float(high),
    }


def rate_lines(rates: pd.DataFrame) -> list[list[str]]:
    """The cells of each row, as HEADER names them."""
    return [
        [
            row["part"] or "all",
            row["skill"],
            _rate_text(row, "own"),
            _rate_text(row, "after"),
            *(_number(row[name], 3) for name in ("value_spread", "dynamics_spread")),
            *(_number(row[name], 1) for name in ("beta", "beta_scaled")),
        ]
        for row in rates.to_dict("records")
    ]


def _rate_text(row: Record, name: str) -> str:
    if not row[f"{name}_trials"]:
        return "–"
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    counts = f"{row[f'{name}_successes']} of {row[f'{name}_trials']}"
    return f"{row[f'{name}_rate']:.2f} ({counts}) [{low:.2f}, {high:.2f}]"


def _number(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"
