"""The numbers printed in the paper, and what can be checked about them without running anything."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

PAPER = "Offline Model-Based Skill Stitching"

HALF_DIGIT = 0.0005
"""Scores are printed to three decimals: each stands for everything this close to it."""

NET_GAIN = "net-gain"
"""The pseudo-method under which Table 5's last column is filed."""


@lru_cache(maxsize=1)
def _read() -> pd.DataFrame:
    path = Path(__file__).with_name("tables.csv")
    return pd.read_csv(path, dtype={"table": str}, keep_default_na=False, na_values={"error": [""]})


def paper_table(number: str) -> pd.DataFrame:
    """Columns row, tasks, method, score, error, note of a table of the paper; empty if it has none.

    `tasks` is over how many tasks a row's scores are means (`analysis.paper.tasks` has which).
    `error` is the number after the paper's ±, which it calls the variance over three seeds.
    """
    cells = _read()
    return cells[cells["table"] == number].drop(columns="table").reset_index(drop=True)


def paper_scores(number: str) -> dict[tuple[str, str], tuple[float, float]]:
    """(row, method) -> (score, error) of one table, without Table 5's net gains."""
    cells = paper_table(number)
    keys = zip(cells["row"], cells["method"], strict=True)
    numbers = zip(cells["score"], cells["error"], strict=True)
    return {key: cell for key, cell in zip(keys, numbers, strict=True) if key[1] != NET_GAIN}


def accomplished_skills(number: str, method: str) -> pd.Series:
    """Score × task length of a method in a table whose rows read "<length> <noun>"."""
    cells = paper_table(number).query("method == @method").set_index("row")["score"]
    lengths = np.array([int(row.split()[0]) for row in cells.index])
    return cells * lengths
