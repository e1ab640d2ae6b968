"""What the paper's Table 8 implies for first and second skills, by linear programming.

A cell of Table 8 is a mean over tasks of (accomplished skills / skills), and what is accomplished
of A > B > C > D begins with what is accomplished of A > B > C. So each cell is a linear function of
the success rates of prefixes, p(A), p(A > B), ..., where no prefix succeeds more often than its
parent. Whatever is a mean of such rates has a least and a largest value that fit the printed cells.

`python -m analysis.paper.implied` works all of them out anew, in a few seconds, and writes the
file that `bounds` reads.
"""

from functools import cache
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import linprog
from scipy.sparse import block_diag, csr_array

from analysis.paper.numbers import HALF_DIGIT, paper_table
from analysis.tables.writers import to_csv

FIRST, SECOND = "first", "second"
MEAN = "mean"
"""In the place of a skill: the mean over all first skills, or over all pairs of skills."""

COLUMNS = ["method", "kind", "skill", "low", "high"]
FILE = Path(__file__).with_name("implied.csv")

_TABLE, _ARROW = "8", " → "
_ROUNDING = HALF_DIGIT + 1e-5  # a little more than a printed score can be off
_LONGEST = 4

Prefix = tuple[str, ...]


@cache
def _read() -> pd.DataFrame:
    return pd.read_csv(FILE)


def known_methods() -> list[str]:
    """The methods of Table 8, as specs call them."""
    return list(dict.fromkeys(paper_table(_TABLE)["method"]))


def bounds(method: str) -> pd.DataFrame:
    """Columns kind, skill, low, high: what Table 8 allows for a method's success rates.

    FIRST: that a task's first skill succeeds. SECOND: that the first two succeed, averaged over
    what comes first; so it is not conditional on the first. One row a skill, by its label in the
    paper, and one for their MEAN. Raises KeyError for a method that is not in the table.
    """
    if method not in known_methods():
        raise KeyError(f"{method} is not in the paper's Table 8: {', '.join(known_methods())}")
    known = _read()
    return known[known["method"] == method].drop(columns="method").reset_index(drop=True)


def skills() -> list[str]:
    """The seven skills in Table 8's order."""
    rows = paper_table(_TABLE)["row"]
    return list(dict.fromkeys(row.split(_ARROW)[-1] for row in rows))


def averaged(kind: str, skill: str) -> list[Prefix]:
    """The prefixes whose success rates a row of `bounds` is the mean of."""
    length = {FIRST: 1, SECOND: 2}[kind]
    return [p for p in _prefixes() if len(p) == length and skill in (MEAN, p[-1])]


def work_out(method: str, kind: str, skill: str) -> tuple[float, float]:
    """The least and the largest rate that Table 8 allows: two linear programs."""
    prefixes = averaged(kind, skill)
    weights = _sum_of(prefixes)[0] / len(prefixes)
    return _least(method, weights), -_least(method, -weights)


def _least(method: str, weights: np.ndarray) -> float:
    """The least weighted sum of success rates that fits the method's cells."""
    rows, limits = _fits(method)
    A: Any = rows  # linprog takes sparse matrices; its type stubs do not say so
    found = linprog(weights, A_ub=A, b_ub=limits, bounds=(0, 1), method="highs")
    assert found.fun is not None, "Table 8 fits no success rates"
    return float(found.fun)


def can_share_first_skills(one: str, other: str) -> bool:
    """Whether any success rates of first skills fit Table 8's cells of both methods."""
    (rows, limits), (other_rows, other_limits) = _fits(one), _fits(other)
    first = np.eye(len(skills()), len(_prefixes()))  # first skills are the first prefixes
    found = linprog(
        np.zeros(2 * len(_prefixes())),
        A_ub=block_diag([rows, other_rows]),
        b_ub=np.concatenate([limits, other_limits]),
        A_eq=np.hstack([first, -first]),
        b_eq=np.zeros(len(first)),
        bounds=(0, 1),
        method="highs",
    )
    return bool(found.success)


def work_out_all() -> pd.DataFrame:
    """COLUMNS, all of it worked out."""
    rows = [
        (method, kind, skill, *work_out(method, kind, skill))
        for method, kind, skill in product(known_methods(), (FIRST, SECOND), [*skills(), MEAN])
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


@cache
def _prefixes() -> dict[Prefix, int]:
    """Every prefix → its variable in the linear programs, shorter ones first."""
    every = [p for depth in range(1, _LONGEST + 1) for p in permutations(skills(), depth)]
    return {prefix: number for number, prefix in enumerate(every)}


def _sum_of(prefixes: list[Prefix]) -> np.ndarray:
    """(1, prefixes) how often each is in the list."""
    numbers = [_prefixes()[prefix] for prefix in prefixes]
    return np.bincount(numbers, minlength=len(_prefixes()))[None].astype(float)


@cache
def _fits(method: str) -> tuple[csr_array, np.ndarray]:
    """Coefficients (constraints, prefixes) and limits: coefficients @ rates <= limits."""
    rows, limits = [], []
    cells = paper_table(_TABLE).query("method == @method")
    for row, score in zip(cells["row"], cells["score"], strict=True):
        *before, last = row.split(_ARROW)
        length = len(before) + 1
        tasks = [prefix for prefix in _prefixes() if len(prefix) == length and prefix[-1] == last]
        accomplished = _sum_of([task[:depth] for task in tasks for depth in range(1, length + 1)])
        rows += [accomplished, -accomplished]
        skills_asked = len(tasks) * length
        limits += [skills_asked * (_ROUNDING + score), skills_asked * (_ROUNDING - score)]
    for prefix in _prefixes():
        if len(prefix) > 1:
            rows.append(_sum_of([prefix]) - _sum_of([prefix[:-1]]))
            limits.append(0.0)
    return csr_array(np.concatenate(rows)), np.array(limits)


if __name__ == "__main__":
    FILE.write_text(to_csv(work_out_all()), encoding="utf-8", newline="\n")
