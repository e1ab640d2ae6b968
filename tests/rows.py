"""One row of a table, as a row: by a key alone, type checkers take it for a number."""

import pandas as pd


def row(table: pd.DataFrame, *key: str | int) -> pd.Series:
    """The one under this key of the table's index."""
    found = table.xs(key if len(key) > 1 else key[0])
    assert isinstance(found, pd.Series)
    return found
