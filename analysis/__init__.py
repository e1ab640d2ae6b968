"""The paper's numbers, statistics, tables, figures and the report.

Reads finished ledgers; trains and simulates nothing, and imports none of Ray, torch or MuJoCo. Only
`analysis.render`, which a report starts as a process of its own, draws with MuJoCo.

    from analysis import open_run
    open_run("runs/table1-paper").scores("table1")
"""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.opened import OpenedRun

__all__ = ["open_run"]


def open_run(directory: str | PathLike[str]) -> OpenedRun:
    """What a run directory holds, as pandas tables.

    Raises RunError (`analysis.schema`) where it is none, or nothing has been played in it.
    """
    from pathlib import Path

    from analysis.opened import OpenedRun
    from analysis.run import load_run

    return OpenedRun(load_run(Path(directory)))
