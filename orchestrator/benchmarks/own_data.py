"""People's own data as a dataset of a plan: named by their content."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from orchestrator.benchmarks.entry import Dataset
from orchestrator.errors import UsageError
from stitching.data.own.recordings import METADATA, is_minari_dataset, recordings_at


def own_dataset(kind: str, source: str, setting: str = "data.file") -> dict[str, Dataset]:
    """The only dataset of a plan whose data are people's own: nothing else is learned from.

    kind: what is made of them. source: an .npz file or the id of a Minari dataset, as `setting` has
    it. Another content is another dataset, whatever its name. Raises UsageError where there is
    none.
    """
    return {"demonstrations": Dataset(kind, {"sha256": _sha256(_checked_place(setting, source))})}


def own_label(config: Any) -> str:
    """Of data settings with a `file`, for titles of tables; "" where it is not set."""
    return f"data: {Path(config.file).name}" if config.file else ""


def _checked_place(setting: str, source: str) -> Path:
    """Where they are; before anything is read, for a folder may hold anything."""
    if not source:
        raise UsageError(
            f"{setting}: name an .npz file or a Minari dataset, as D4RL/kitchen/complete-v2"
        )
    place = recordings_at(source)
    if source.endswith(".npz"):
        if not place.is_file():
            raise UsageError(f"{setting}: no file {source}")
    elif not place.exists():
        raise UsageError(
            f"{setting}: no Minari dataset at {place}; fetch it with `minari download {source}`, "
            "or set MINARI_DATASETS_PATH to where it is"
        )
    elif not is_minari_dataset(place):
        raise UsageError(
            f"{setting}: {place} is neither an .npz file nor a Minari dataset, which would have "
            f"{METADATA}"
        )
    return place


def _sha256(place: Path) -> str:
    """Of a file, or of all files in a folder, with their names."""
    files = [place] if place.is_file() else sorted(p for p in place.rglob("*") if p.is_file())
    total = hashlib.sha256()
    for file in files:
        total.update(str(file.relative_to(place)).encode())
        with file.open("rb") as content:
            total.update(hashlib.file_digest(content, "sha256").digest())
    return total.hexdigest()
