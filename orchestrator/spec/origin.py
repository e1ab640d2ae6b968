"""How what was asked stands to the packaged file of its name and to the defaults.

And the command that asks for it again. For readers of a run directory, who may have other code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

from analysis.schema import leaves
from orchestrator.errors import UsageError
from orchestrator.spec.methods import method_name, settings_with_effect
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.spec.suite import Suite, load_asked
from orchestrator.spec.tomls import packaged_specs
from stitching.methods.registry import METHODS
from stitching.registry import field_name

Difference = tuple[str, Any, Any]
"""A field by its path, its value here, and there; None where one side has no such field."""

WHICH_FILE = ("name", "scale", "benchmark")  # say which file and scale are compared with


class NoOptionError(Exception):
    """A field that no option can set so."""


def origin(asked: Spec | Suite) -> Plain:
    """What `analysis.schema.Origin` reads: differences, and the command as words.

    Without a packaged file of that name and scale there is neither a command nor what was changed
    in the file. There is no command either where no option sets a field so.
    """
    parts, packaged = _parts(asked), _packaged(asked)
    pairs = {label: (_own_fields(parts[label]), _own_fields(packaged[label])) for label in packaged}
    return {
        "packaged": asked.name if packaged else "",
        "command": _command(asked, list(pairs.values())) if packaged else [],
        "changed": _gathered({label: _differences(*pair) for label, pair in pairs.items()}),
        "defaults": _gathered({label: _not_default(spec) for label, spec in parts.items()}),
    }


def _parts(asked: Spec | Suite) -> dict[str, Spec]:
    """The runs asked for by their labels; one alone has none."""
    if isinstance(asked, Suite):
        return {part.label: part.spec for part in asked.parts}
    return {"": asked}


def _packaged(asked: Spec | Suite) -> dict[str, Spec]:
    """The packaged runs of that name and scale; none where they are of other parts or benchmarks.

    A file of somebody's own may have any name.
    """
    if asked.name not in packaged_specs():
        return {}
    try:
        parts = _parts(load_asked(asked.name, asked.scale))
    except UsageError:  # it has no such scale
        return {}
    there, here = (
        {label: spec.benchmark for label, spec in each.items()} for each in (parts, _parts(asked))
    )
    return parts if there == here else {}


def _own_fields(spec: Spec) -> Plain:
    """Without what says which file it is."""
    return {name: value for name, value in to_plain(spec).items() if name not in WHICH_FILE}


def _not_default(spec: Spec) -> list[Difference]:
    """Settings that the run depends on, where they are not the defaults of their dataclasses."""
    here, defaults = _own_fields(spec), _defaults(spec)
    used: dict[str, set[str]] = {}
    for method in spec.methods:
        names = settings_with_effect(spec.method_settings(method))
        used.setdefault(field_name(method_name(method)), set()).update(names)
    for plain in (here, defaults):
        for section in map(field_name, METHODS):
            if section in plain:
                kept = used.get(section, set())
                plain[section] = {name: v for name, v in plain[section].items() if name in kept}
    return _differences(*({name: plain[name] for name in defaults} for plain in (here, defaults)))


def _defaults(spec: Spec) -> Plain:
    """Of every field that has one."""
    named: Plain = {"data": to_plain(type(spec.data)())}
    for field in fields(spec):
        if field.name in (*WHICH_FILE, "tables"):
            continue
        if field.default is not MISSING:
            named[field.name] = to_plain(field.default)
        elif field.default_factory is not MISSING:
            named[field.name] = to_plain(field.default_factory())
    return named


def _differences(here: Plain, there: Plain) -> list[Difference]:
    ours, theirs = (leaves(plain | _by_id(plain), ".") for plain in (here, there))
    paths = list(dict.fromkeys([*ours, *theirs]))
    return [
        (path, ours.get(path), theirs.get(path))
        for path in paths
        if ours.get(path) != theirs.get(path)
    ]


def _by_id(plain: Plain) -> Plain:
    """Tables by their ids, so that their fields have paths as well."""
    return {"tables": {table["id"]: table for table in plain.get("tables", ())}}


def _gathered(by_part: Mapping[str, list[Difference]]) -> list[list[Any]]:
    """First what all parts have in common, once; before the others the label of their part."""
    every = list(by_part.values())
    common = [one for one in every[0] if all(one in other for other in every)] if every else []
    return [list(one) for one in common] + [
        [f"{label}: {path}", here, there]
        for label, differences in by_part.items()
        for path, here, there in differences
        if (path, here, there) not in common
    ]


def _command(asked: Spec | Suite, parts: list[tuple[Plain, Plain]]) -> list[str]:
    """The words of `skillstitch run`; none where no options, which apply to all parts, do it."""
    try:
        options = [_options(here, there, "") for here, there in parts]
    except NoOptionError:
        return []
    every = {path: words for part in options for path, words in part.items()}
    for (here, _), part in zip(parts, options, strict=True):
        as_there = leaves(here, ".")
        if any(part.get(path, _words(path, as_there.get(path))) != every[path] for path in every):
            return []
    words = [word for option in every.values() for word in option]
    return ["skillstitch", "run", asked.name, "--scale", asked.scale, *words]


def _options(here: Any, there: Any, path: str) -> dict[str, list[str]]:
    """The option of each field that is not as there. NoOptionError where there is none."""
    if here == there:
        return {}
    if isinstance(here, list) and all(isinstance(one, dict) for one in [*here, *there]):
        here, there = (dict(enumerate(value)) for value in (here, there))
    if not isinstance(here, dict):
        return {path: _words(path, here)}
    if not there:
        pairs = [str(word) for pair in here.items() for word in pair]
        return {path: [_flag(path), *pairs]}
    if here.keys() != there.keys():
        raise NoOptionError(path)
    below = [_options(here[key], there[key], f"{path}.{key}".lstrip(".")) for key in here]
    return {name: words for options in below for name, words in options.items()}


def _words(path: str, value: Any) -> list[str]:
    if isinstance(value, bool):
        whole, _, last = path.rpartition(".")
        return [_flag(path) if value else _flag(f"{whole}.no-{last}".lstrip("."))]
    return [_flag(path), *map(str, value if isinstance(value, list) else [value])]


def _flag(path: str) -> str:
    return f"--{path.replace('_', '-')}"
