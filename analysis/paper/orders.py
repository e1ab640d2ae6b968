"""Table 4's claim (4.3.1): one policy of a long task leads in that task's order, and only there."""

from __future__ import annotations

import pandas as pd

from analysis.paper.numbers import paper_scores

LONG_TASK = "microwave → kettle → bottom burner → light switch"
"""What the paper's Single-Policy has seen, as rows of tables name it; claims are of no other."""

SAME, OTHER = "same order", "other orders"
CLAIMED = {SAME: ("single-policy", "mb-stitch"), OTHER: ("mb-stitch", "single-policy")}
"""Group of rows -> its leader in the paper, and over whom."""

Cells = dict[tuple[str, str], pd.DataFrame]
"""(row, method) -> its episodes; rows and methods in the table's order."""


def order_of(row: str) -> str:
    """Whether a task is the long one's beginning, or all of it."""
    return SAME if f"{LONG_TASK} → ".startswith(f"{row} → ") else OTHER


def by_order(cells: Cells) -> Cells:
    """(group, method) -> the episodes of its rows."""
    parts: dict[tuple[str, str], list[pd.DataFrame]] = {}
    for (row, method), played in cells.items():
        parts.setdefault((order_of(row), method), []).append(played)
    return {group: pd.concat(played) for group, played in parts.items()}


def order_duels(groups: Cells, paper: str, long_task: str) -> list[tuple[str, str, str]]:
    """(group, the paper's leader, the other), where the paper's table and this one have both.

    long_task: what this run's Single-Policy has seen; none where it is not the paper's.
    """
    if long_task != LONG_TASK:
        return []
    printed = {method for _, method in paper_scores(paper)}
    return [
        (group, *duel)
        for group, duel in CLAIMED.items()
        if set(duel) <= printed and all((group, method) in groups for method in duel)
    ]
