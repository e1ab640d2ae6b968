"""What is kept with the code: whether a run may take the place of what is there."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from analysis.files import can_write, existing_above
from analysis.schema import PROVENANCE, RunError

SCALES = ("smoke", "quick", "standard", "paper")  # from the smallest
EXPORTED = ("counts", "cpu", "git_revision", "system", "versions")  # of a run's provenance
DATA = (".csv", ".parquet", ".json")
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


def write_provenance(draft: Path, folder: Path, provenance: dict[str, Any], extent: Extent) -> None:
    """Add provenance.json to a draft that holds all else of what is to replace a folder.

    Where the draft's data are the folder's to the byte, what made those is said again: so it tells
    of the first run that had these results, and running it again changes no file.
    """
    same = extent_of(folder) == extent and _data(draft) == _data(folder)
    text = provenance_text(provenance, extent)
    if same:
        text = (folder / PROVENANCE).read_text(encoding="utf-8")
    (draft / PROVENANCE).write_text(text, encoding="utf-8")


def provenance_text(provenance: dict[str, Any], extent: Extent) -> str:
    """What an exported folder's provenance.json says: with what it was made, not when or how fast.

    Times, and what they depend on, are in the run's own directory.
    """
    said = {name: provenance[name] for name in EXPORTED if name in provenance} | {"extent": extent}
    return json.dumps(said, indent=2, sort_keys=True, ensure_ascii=False) + "\n"


def _data(folder: Path) -> dict[str, bytes]:
    """Every file that holds results, by name: pictures and texts are drawn from these."""
    files = (file for file in folder.glob("*") if file.suffix in DATA and file.name != PROVENANCE)
    return {file.name: file.read_bytes() for file in files}


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
