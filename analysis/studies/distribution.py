"""Interquartile means of a table, where its rows have many tasks."""

import pandas as pd

from analysis.tables.table import Table
from analysis.tables.writers import seed_note

COLUMNS = ["row", "method", "iqm", "ci_low", "ci_high", "mean", "tasks", "seeds"]

NOTE = (
    "Interquartile means (Agarwal et al., 2021) of rows with many tasks. Each task has a score "
    "under each seed's models; the highest quarter and the lowest of these are left out, so that "
    "the few tasks that always succeed or always fail do not decide. 95 % intervals are from "
    "resampling seeds, each with all of its tasks."
)
ONE_SEED = "With one seed there is nothing to resample, and so no interval."
SOME_OF_ONE_SEED = "Cells of one seed have no interval."


def distribution_table(table: Table) -> pd.DataFrame:
    """COLUMNS, one row a cell with many tasks; `mean` is of the same scores, none left out."""
    records = [
        (row, method, of.iqm, of.iqm_low, of.iqm_high, of.mean, of.tasks, of.seeds)
        for (row, method), of in table.distributions.items()
    ]
    return pd.DataFrame(records, columns=COLUMNS)


def distribution_header(table: Table) -> list[str]:
    """Of `distribution_lines`."""
    return ["Task", *(table.labels[method] for method in table.methods)]


def distribution_lines(table: Table, found: pd.DataFrame) -> list[list[str]]:
    """A line a row: its tasks, and each method's interquartile mean with its interval."""
    cells = {(cell["row"], cell["method"]): cell for cell in found.to_dict("records")}
    lines = []
    for row, tasks in found.groupby("row", sort=False)["tasks"]:
        fewest, most = tasks.min(), tasks.max()
        texts = []
        for method in table.methods:
            cell = cells.get((row, method))
            if cell is None:
                texts.append("–")
            elif cell["seeds"] == 1:
                texts.append(f"{cell['iqm']:.3f}")
            else:
                texts.append(f"{cell['iqm']:.3f} [{cell['ci_low']:.3f}, {cell['ci_high']:.3f}]")
        count = f"{most}" if fewest == most else f"{fewest} to {most}"
        lines.append([f"{row} ({count} tasks)", *texts])
    return lines


def distribution_note(found: pd.DataFrame) -> str:
    """What the table shows, and what its intervals rest on."""
    several = found["seeds"][found["seeds"] > 1]
    if several.empty:
        return f"{NOTE} {ONE_SEED}"
    note = f"{NOTE} {seed_note(int(several.min()))}"
    return note if len(several) == len(found) else f"{note} {SOME_OF_ONE_SEED}"
