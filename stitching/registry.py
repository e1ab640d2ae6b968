"""Parts that can be added: those of this package, and what other installed packages bring.

Another package offers a part under an entry point, as in its pyproject.toml:

    [project.entry-points."skillstitch.methods"]
    repeat-stitch = "my_package.repeat:REPEAT_STITCH"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass, make_dataclass
from importlib.metadata import EntryPoint, entry_points
from keyword import iskeyword
from typing import Any, TypeVar

from stitching.bounds import Bounded

T = TypeVar("T")

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


class PartError(ImportError):
    """A part of another package cannot be used."""


def with_installed(group: str, own: Mapping[str, T], wrong: Callable[[Any], str]) -> dict[str, T]:
    """`own` parts by name, and after them those of an entry point group.

    `wrong` says what keeps a part from being one, empty where nothing does. Raises PartError,
    naming package and entry point, where a part of another package cannot be loaded, is wrong, or
    has a name that is taken or cannot be a field's.
    """
    parts = dict(own)
    for point in sorted(entry_points(group=group), key=lambda point: point.name):
        package = point.dist.name if point.dist is not None else "an installed package"
        where = f"{package}, entry point {point.name!r} of {group}"
        if not NAME.fullmatch(point.name) or iskeyword(point.name):
            raise PartError(
                f"{where}: names have small letters, digits and '-' between words, and are no "
                "keywords of Python"
            )
        if point.name in parts:
            raise PartError(f"{where}: this name is taken")
        part = _load(point, where)
        try:
            problem = wrong(part)
        except Exception as error:
            problem = f"{type(error).__name__}: {error}"
        if problem:
            raise PartError(f"{where}: {point.value} {problem} (see docs/extending.md)")
        parts[point.name] = part
    return parts


def _load(point: EntryPoint, where: str) -> Any:
    try:
        return point.load()
    except Exception as error:
        raise PartError(f"{where}: {type(error).__name__}: {error}") from error


def wrong_settings(settings: Any, base: type) -> str:
    """What keeps a class from being settings of a part, in words; empty where nothing does."""
    if not isinstance(settings, type) or not is_dataclass(settings):
        return "is no dataclass"
    if not issubclass(settings, base):
        return f"does not inherit from {base.__name__}"
    for one in fields(settings):
        if one.default is MISSING and one.default_factory is MISSING:
            return f"has no default for {one.name!r}"
    if not settings.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        return "is not frozen: write @dataclass(frozen=True)"
    try:
        settings()
    except (TypeError, ValueError) as error:
        return f"has a default that does not fit: {error}"
    return ""


def lacking(owner: Any, asked: tuple[str, ...]) -> str:
    """The first of some attributes that it has not; empty where it has all."""
    return next((name for name in asked if not hasattr(owner, name)), "")


def is_ours(part: type) -> bool:
    """Whether a class is this package's."""
    return part.__module__.partition(".")[0] == __name__.partition(".")[0]


def field_name(part: str) -> str:
    """What settings of a part are called in files: those of "mb-stitch" are "mb_stitch"."""
    return part.replace("-", "_")


def sections(name: str, parts: Mapping[str, type]) -> type:
    """A frozen dataclass with a field for the settings of each part, the defaults its own."""
    named = [(field_name(part), settings, settings()) for part, settings in parts.items()]
    return make_dataclass(name, named, bases=(Bounded,), frozen=True)
