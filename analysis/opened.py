"""A run as pandas tables: what was played, scores with their intervals, gains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from analysis.episodes import episodes_from_segments
from analysis.run import Run
from analysis.schema import RunError
from analysis.tables.table import Table, build_table


@dataclass(frozen=True)
class OpenedRun:
    """Tables are worked out as a report's are, with the same intervals."""

    run: Run

    @property
    def segments(self) -> pd.DataFrame:
        """One row for every skill of every episode that was played."""
        return self.run.segments

    @cached_property
    def episodes(self) -> pd.DataFrame:
        """One row for every episode of every task: seed, method, task, accomplished, score, …"""
        return episodes_from_segments(self.run.segments, self.run.spec, self.run.quarantine)

    @property
    def tables(self) -> list[str]:
        """The ids of the run's tables."""
        return [entry.id for entry in self.run.spec.tables]

    def table(self, table: str = "") -> Table:
        """With all that is printed beside it; without an id the first one. RunError: no such id."""
        entries = {entry.id: entry for entry in self.run.spec.tables}
        name = table or next(iter(entries), "")
        if name not in entries:
            raise RunError(f"no table {table!r}; there are {', '.join(entries)}")
        return build_table(self.episodes, self.run.spec, entries[name])

    def scores(self, table: str = "") -> pd.DataFrame:
        """A line for each cell: row, method, score, ci_low, ci_high, …, paper_score."""
        return self.table(table).scores

    def gains(self, table: str = "") -> pd.DataFrame:
        """A line for each row and pair of methods: gain, ci_low, ci_high, … of paired episodes."""
        return self.table(table).gains
