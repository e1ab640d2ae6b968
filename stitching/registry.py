"""Parts that can be added: those of this package, and what other installed packages bring.

Another package offers a part under an entry point, as in its pyproject.toml:

    [project.entry-points."skillstitch.methods"]
    repeat-stitch = "my_package.repeat:REPEAT_STITCH"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import make_dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from stitching.bounds import Bounded

T = TypeVar("T")

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


class PartError(ImportError):
    """A part of another package cannot be used."""


def with_installed(group: str, own: Mapping[str, T], fits: Callable[[Any], bool]) -> dict[str, T]:
    """`own` parts by name, and after them those of an entry point group for which `fits` holds.

    Raises PartError, naming package and entry point, where a part of another package cannot be
    loaded, does not fit, or has a name that is taken or cannot be made a field's.
    """
    parts = dict(own)
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        package = point.dist.name if point.dist is not None else "an installed package"
        where = f"{package}, entry point {point.name!r} of {group}"
        if not NAME.fullmatch(point.name):
            raise PartError(f"{where}: names have small letters, digits and '-' between words")
        if point.name in parts:
            raise PartError(f"{where}: this name is taken")
        part = _load(point, where)
        if not fits(part):
            raise PartError(f"{where}: {point.value} is not what {group} are: docs/extending.md")
        parts[point.name] = part
    return parts


def _load(point: EntryPoint, where: str) -> Any:
    try:
        return point.load()
    except Exception as error:
        raise PartError(f"{where}: {type(error).__name__}: {error}") from error


def field_name(part: str) -> str:
    """What settings of a part are called in files: those of "mb-stitch" are "mb_stitch"."""
    return part.replace("-", "_")


def sections(name: str, parts: Mapping[str, type]) -> type:
    """A frozen dataclass with a field for the settings of each part, the defaults its own."""
    fields = [(field_name(part), settings, settings()) for part, settings in parts.items()]
    return make_dataclass(name, fields, bases=(Bounded,), frozen=True)
