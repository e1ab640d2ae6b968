"""Ranges of settings, written beside the fields that they hold for.

    updates: Count = 10_000

A dataclass of settings inherits from `Bounded`, so that no object of it exists whose numbers make
no sense, wherever they come from.
"""

from __future__ import annotations

import math
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from annotated_types import Interval

Count = Annotated[int, Interval(ge=1, le=10**7)]
Amount = Annotated[int, Interval(ge=0, le=10**7)]
Width = Annotated[int, Interval(ge=1, le=2**14)]  # of a layer: wider ones fill the memory
WidthOrNone = Annotated[int, Interval(ge=0, le=2**14)]
Few = Annotated[int, Interval(ge=1, le=1000)]  # members, layers, seeds, steps of a plan
FewOrNone = Annotated[int, Interval(ge=0, le=1000)]
Episodes = Annotated[int, Interval(ge=1, le=10**5)]
SeedNumber = Annotated[int, Interval(ge=0, lt=1000)]  # one of a spec's seeds
Seed = Annotated[int, Interval(ge=0, lt=2**63)]

Positive = Annotated[float, Interval(gt=0, le=10**6)]  # what is larger drowns all beside it
NotNegative = Annotated[float, Interval(ge=0, le=10**6)]
Times = Annotated[float, Interval(ge=0, le=1000)]  # as much as is usual
LearningRate = Annotated[float, Interval(gt=0, le=1)]
Share = Annotated[float, Interval(ge=0, le=1)]
ShareBelowOne = Annotated[float, Interval(ge=0, lt=1)]
ShareAboveZero = Annotated[float, Interval(gt=0, le=1)]
Inside = Annotated[float, Interval(gt=0, lt=1)]


class Bounded:
    """What dataclasses of settings inherit from: the ranges of their fields hold."""

    def __post_init__(self) -> None:
        """Raise ValueError "field: must …" where a number lies outside its range.

        Every float must be finite. Ranges within tuples, dicts and unions hold for what these
        contain; a dataclass within a dataclass checks itself.
        """
        for name, hint in get_type_hints(type(self), include_extras=True).items():
            _check(hint, getattr(self, name), name)


def _check(hint: Any, value: Any, where: str) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{where}: must be a finite number: {value}")
    origin, args = get_origin(hint), get_args(hint)
    if origin is Annotated:
        for bound in args[1:]:
            if isinstance(bound, Interval) and (should := _broken(bound, value)):
                raise ValueError(f"{where}: must be {should}: {value}")
        _check(args[0], value, where)
    elif origin in (Union, UnionType) and value is not None:
        for option in args:
            if option is not type(None):
                _check(option, value, where)
    elif origin is tuple:
        for number, item in enumerate(value):
            _check(args[0], item, f"{where}[{number}]")
    elif origin is dict:
        for key, item in value.items():
            _check(args[0], key, where)
            _check(args[1], item, f"{where}, {key}")


def _broken(bound: Interval, value: Any) -> str:
    """What a value should be and is not, else an empty text."""
    if bound.ge is not None and not value >= bound.ge:
        return f"at least {bound.ge}"
    if bound.gt is not None and not value > bound.gt:
        return f"above {bound.gt}"
    if bound.le is not None and not value <= bound.le:
        return f"at most {bound.le}"
    if bound.lt is not None and not value < bound.lt:
        return f"below {bound.lt}"
    return ""
