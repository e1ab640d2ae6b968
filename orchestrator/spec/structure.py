"""Frozen dataclasses from plain data and back: strict, typed, and without executing anything."""

from __future__ import annotations

import types
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from orchestrator.errors import UsageError

T = TypeVar("T")
Plain = dict[str, Any]  # what JSON and TOML can hold


def structure(cls: type[T], plain: Any, where: str) -> T:
    """Build `cls` from a dict. UsageError names the field and lists the valid ones."""
    if not isinstance(plain, dict):
        raise UsageError(f"{where}: expected a table of fields, got {plain!r}")
    known = {field.name: field for field in fields(cls)}  # type: ignore[arg-type]
    hints = get_type_hints(cls)
    if unknown := [key for key in plain if key not in known]:
        tables_last = sorted(known, key=lambda name: is_dataclass(hints[name]))
        valid = ", ".join(tables_last)
        raise UsageError(f"{where}: unknown field {unknown[0]!r}; valid are {valid}")
    missing = [
        name
        for name, field in known.items()
        if name not in plain and field.default is MISSING and field.default_factory is MISSING
    ]
    if missing:
        raise UsageError(f"{where}: field {missing[0]!r} is missing")
    values = {name: _value(hints[name], value, f"{where}, {name}") for name, value in plain.items()}
    with settings_of(where):
        return cls(**values)


@contextmanager
def settings_of(where: str) -> Iterator[None]:
    """What a dataclass of settings says of values that do not fit becomes a UsageError."""
    try:
        yield
    except ValueError as error:
        raise UsageError(f"{where}, {error}") from error


def _value(hint: Any, value: Any, where: str) -> Any:
    if hint is Any:
        return value
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _value(args[0], value, where)
    if origin in (Union, types.UnionType):
        return _first_fitting(args, value, where)
    if is_dataclass(hint):
        if isinstance(value, hint):  # type: ignore[arg-type]
            return value
        return structure(hint, value, where)  # type: ignore[arg-type]
    if origin is Literal:
        if value not in args:
            raise UsageError(f"{where}: {value!r} is not one of {', '.join(map(str, args))}")
        return value
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise UsageError(f"{where}: expected a list, got {value!r}")
        return tuple(_value(args[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if origin is dict:
        if not isinstance(value, dict):
            raise UsageError(f"{where}: expected a table, got {value!r}")
        return {_key(args[0], k, where): _value(args[1], v, where) for k, v in value.items()}
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not hint:
        raise UsageError(f"{where}: expected {hint.__name__}, got {value!r}")
    return value


def _first_fitting(options: tuple[Any, ...], value: Any, where: str) -> Any:
    problems = []
    for option in options:
        try:
            return _value(option, value, where)
        except UsageError as error:
            problems.append(str(error))
    raise UsageError("; or ".join(problems))


def _key(hint: type, text: Any, where: str) -> Any:
    try:
        return hint(text)  # TOML and JSON know only text as keys
    except ValueError:
        raise UsageError(f"{where}: key {text!r} is not {hint.__name__}") from None


def to_plain(value: Any) -> Any:
    """Dataclasses → dicts, tuples → lists, as JSON and TOML hold them."""
    if is_dataclass(value):
        return {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    return value


def merged(base: Plain, overlay: Plain) -> Plain:
    """The overlay's fields over the base's, tables within tables likewise."""
    result = dict(base)
    for key, value in overlay.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        result[key] = merged(base[key], value) if both else value
    return result


def nested(flat: Plain) -> Plain:
    """{"cem.horizon": 3} → {"cem": {"horizon": 3}}."""
    tables: Plain = {}
    for path, value in flat.items():
        for name in reversed(path.split(".")):
            value = {name: value}
        tables = merged(tables, value)
    return tables


def plain_differences(old: Any, new: Any, path: str = "") -> list[str]:
    """A line for each field in which two plain values differ."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = sorted(old.keys() | new.keys(), key=str)
        return [
            line
            for key in keys
            for line in plain_differences(old.get(key), new.get(key), f"{path}.{key}".lstrip("."))
        ]
    return [] if old == new else [f"{path}: {old!r} → {new!r}"]
