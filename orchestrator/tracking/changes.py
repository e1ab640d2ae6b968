"""In what a run's spec differs from the packaged one of its name, for the name of the run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

SYMBOLS = {"mb_stitch.alpha": "α", "mb_stitch.beta": "β"}
MOST = 3  # changes that a name tells
LONGEST = 40  # of each
UNTOLD = ("title", "tables")


def short_changes(changed: Iterable[tuple[str, Any, Any]]) -> str:
    """ "α 5, seeds 2": for a name.

    changed: as `analysis.schema.Origin` has it.
    """
    told = [
        f"{SYMBOLS.get(path, path)} {_short(here)}"
        for path, here, _ in changed
        if path.partition(".")[0] not in UNTOLD
    ]
    more = [f"{len(told) - MOST} more"] if len(told) > MOST else []
    return ", ".join([*(one[:LONGEST] for one in told[:MOST]), *more])


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "+".join(map(_short, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
