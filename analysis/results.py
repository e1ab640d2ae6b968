"""What is kept with the code: whether a run may take the place of what is there."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from analysis.files import can_write, existing_above
from analysis.schema import PROVENANCE, RunError

SCALES = ("smoke", "quick", "standard", "paper")  # from the smallest
Extent = dict[str, str | int]
"""How much there is of results: {"scale": "quick", "seeds": 1, "episodes": 10, …}."""


def check_results(results: Path, names: Iterable[str], extent: Extent, force: bool) -> None:
    """Raise RunError where results/<name>/ cannot be written, or holds larger ones.

    Larger is what has a larger scale, or more of anything that both extents tell. Asked before a
    run, so that it does not end in vain, and again when its tables are written. With `force`
    anything is replaced; so is what tells no extent.
    """
    try:
        existing = existing_above(results)
    except OSError as error:
        reason = f"cannot be looked at ({error.strerror}); name another"
        raise RunError(f"{results}: {reason}") from error
    if not can_write(existing):
        raise RunError(f"{results}: {existing} is no folder that can be written to; name another")
    for name in names:
        kept = extent_of(results / name)
        for what in sorted(kept.keys() & extent.keys()):
            if not force and _size(extent[what]) < _size(kept[what]):
                raise RunError(
                    f"{results / name} holds more, {what} {kept[what]} against {extent[what]}: "
                    "export to another folder, or say --force to replace it"
                )


def _size(value: str | int) -> int:
    return SCALES.index(value) if isinstance(value, str) else value


def provenance_text(provenance: dict[str, Any], extent: Extent) -> str:
    """What an exported folder's provenance.json says."""
    said = provenance | {"extent": extent}
    return json.dumps(said, indent=2, sort_keys=True, ensure_ascii=False) + "\n"


def extent_of(folder: Path) -> Extent:
    """Of the results in a folder; {} where there are none, or they do not say."""
    file = folder / PROVENANCE
    try:
        extent = dict(json.loads(file.read_text(encoding="utf-8")).get("extent", {}))
    except FileNotFoundError:
        return {}
    except (ValueError, TypeError, AttributeError, OSError) as error:
        raise RunError(f"{file}: unreadable ({error}); move it away") from error
    if not all(isinstance(value, int) or value in SCALES for value in extent.values()):
        raise RunError(f"{file}: its extent {extent} cannot be read; move it away")
    return extent
