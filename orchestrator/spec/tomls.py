"""Files that describe runs: read by name or path, at one of their scales, over their base."""

from __future__ import annotations

import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Literal, get_args

from orchestrator.errors import UsageError
from orchestrator.spec.structure import Plain, merged

PACKAGED = resources.files("orchestrator.specs")

Scale = Literal["smoke", "quick", "standard", "paper"]


def toml_names(packaged: Traversable) -> list[str]:
    """Names of the TOML files in a packaged folder, sorted."""
    files = (entry.name for entry in packaged.iterdir())
    return sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml"))


def packaged_specs() -> list[str]:
    """Names of the specs that come with the code."""
    return toml_names(PACKAGED)


def load_toml(
    name_or_file: str, scale: Scale, packaged: Traversable, what: str
) -> tuple[Plain, str]:
    """The content of a packaged file by name, or of any file, at a scale; and what to call it.

    TOML holds values only, so a spec cannot execute anything. Raises UsageError, naming it as a
    `what`, for an unknown name, a broken file and an unknown scale.
    """
    content, where = read_toml(name_or_file, packaged, what)
    return at_scale(content, scale, where), where


def read_toml(name_or_file: str, packaged: Traversable, what: str) -> tuple[Plain, str]:
    """The content of a packaged file by name, or of any file, and what to call it."""
    names = toml_names(packaged)
    if name_or_file in names:
        data = packaged.joinpath(f"{name_or_file}.toml").read_bytes()
        where = f"packaged {what} {name_or_file}"
    elif Path(name_or_file).is_file():
        data, where = Path(name_or_file).read_bytes(), name_or_file
    else:
        raise UsageError(
            f"no {what} {name_or_file!r}: neither a file nor one of {', '.join(names)}"
        )
    try:
        return tomllib.loads(data.decode("utf-8-sig")), where
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UsageError(f"{where}: not valid TOML: {error}") from error


def at_scale(content: Plain, scale: Scale, where: str) -> Plain:
    """A file's fields at one of its scales; UsageError lists those that there are."""
    fields = {name: value for name, value in content.items() if name != "scales"}
    scales = content.get("scales", {})
    if not isinstance(scales, dict) or not all(isinstance(s, dict) for s in scales.values()):
        raise UsageError(f"{where}, scales: expected a table of fields for each scale")
    check_scales(scales, where)
    scales = {"paper": {}} | scales
    if scale not in scales:
        raise UsageError(f"{where}: no scale {scale!r}; it has {', '.join(scales)}")
    return merged(fields, scales[scale]) | {"scale": scale}


def check_scales(scales: dict[str, Any], where: str) -> None:
    """Raises UsageError for a name that is no scale."""
    if unknown := [name for name in scales if name not in get_args(Scale)]:
        raise UsageError(
            f"{where}: no scale {unknown[0]!r}; there are {', '.join(get_args(Scale))}"
        )


def based_fields(
    content: Plain,
    scale: Scale,
    packaged: Traversable,
    folder: Path,
    where: str,
    above: tuple[str, ...] = (),
) -> Plain:
    """A spec's fields at a scale, over those of the spec that it names as its `base`, if it does.

    A base is a packaged spec or a file in the folder, taken at the same scale, which need not be
    said again. `above`: the files that have this one as their base.
    """
    own = dict(content)
    name = own.pop("base", "")
    if not name:
        return at_scale(own, scale, where)
    file = _beside(name, packaged, folder)
    base, base_where = read_toml(file, packaged, "spec")
    if "parts" in base:
        raise UsageError(f"{where}: its base {name} is itself a suite; name a spec")
    if base_where in (*above, where):
        raise UsageError(f"{where}: its base {name} is based on it")
    beside = Path(file).parent
    fields = based_fields(base, scale, packaged, beside, base_where, (*above, where))
    own["scales"] = {scale: {}} | own.get("scales", {})
    return merged(fields, at_scale(own, scale, where))


def _beside(base: str, packaged: Traversable, folder: Path) -> str:
    """A packaged spec's name, or a file in the folder, with or without its ending."""
    files = [folder / base, folder / f"{base}.toml"] if base not in toml_names(packaged) else []
    return next((str(file) for file in files if file.is_file()), base)
