"""What is kept with the code: whether a run may take the place of what is there."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path

from analysis.run import RunError

SCALES = ("smoke", "quick", "standard", "paper")  # from the smallest


def check_results(results: Path, names: Iterable[str], scale: str, force: bool) -> None:
    """Raise RunError where results/<name>/ cannot be written, or holds those of a larger scale.

    Asked before a run, so that it does not end in vain, and again when its tables are written. With
    `force` any scale replaces any other. What says no scale is replaced.
    """
    existing = next(path for path in (results, *results.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        raise RunError(f"{results}: {existing} is no folder that can be written to; name another")
    for name in names:
        kept = scale_of(results / name)
        if kept is not None and not force and SCALES.index(scale) < SCALES.index(kept):
            raise RunError(
                f"{results / name} holds results of {kept} scale, which is larger than {scale}: "
                "export to another folder, or say --force to replace them"
            )


def scale_of(folder: Path) -> str | None:
    """The scale of the results in a folder; None where there are none, or they do not say."""
    file = folder / "provenance.json"
    try:
        scale = json.loads(file.read_text(encoding="utf-8")).get("scale")
    except FileNotFoundError:
        return None
    except (ValueError, AttributeError, OSError) as error:
        raise RunError(f"{file}: unreadable ({error}); move it away") from error
    if scale is not None and scale not in SCALES:
        raise RunError(f"{file}: no scale {scale!r}; there are {', '.join(SCALES)}; move it away")
    return scale
