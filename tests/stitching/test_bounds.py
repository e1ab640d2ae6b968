"""Every number of a setting has a range, and nothing outside it can be built."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import pytest
from annotated_types import Interval

from orchestrator.spec.spec import Spec
from stitching.bounds import Amount, Bounded, Count, Inside, NotNegative, Positive, Share, Times
from stitching.methods.registry import METHODS
from sweeps.spec import SweepSpec

# Searched numbers may lie anywhere that their own field allows: the spec is built at the corners.
ANYWHERE = {
    "Dimension.choices", "Dimension.low", "Dimension.high",
    "SweepSpec.constraints", "SweepSpec.enqueued",
}  # fmt: skip


@dataclass(frozen=True)
class Example(Bounded):
    count: Count = 1
    share: Share = 0.5
    inside: Inside = 0.5
    free: float = 0.0
    several: tuple[Amount, ...] = ()
    named: dict[str, NotNegative] | None = None
    maybe: Count | None = None
    price: Positive = 1.0
    weights: dict[str, Times] | None = None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 0}, "count: must be at least 1: 0"),
        ({"count": 10**9}, "count: must be at most 10000000: 1000000000"),
        ({"share": -0.1}, "share: must be at least 0: -0.1"),
        ({"share": 1.1}, "share: must be at most 1: 1.1"),
        ({"inside": 0.0}, "inside: must be above 0: 0.0"),
        ({"inside": 1.0}, "inside: must be below 1: 1.0"),
        ({"share": float("nan")}, "share: must be a finite number: nan"),
        ({"free": float("inf")}, "free: must be a finite number: inf"),
        ({"several": (1, -1)}, r"several\[1\]: must be at least 0: -1"),
        ({"price": 1e7}, "price: must be at most 1000000: 10000000.0"),
        ({"price": 0.0}, "price: must be above 0: 0.0"),
        ({"weights": {"a": 1001.0}}, "weights, a: must be at most 1000: 1001.0"),
        ({"named": {"a": 1.0, "b": -2.0}}, "named, b: must be at least 0: -2.0"),
        ({"maybe": 0}, "maybe: must be at least 1: 0"),
    ],
)
def test_outside_its_range_nothing_is_built(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}$"):
        replace(Example(), **changes)


def test_the_ends_of_a_range_belong_to_it_where_it_says_so() -> None:
    example = Example(count=1, share=1.0, several=(0,), named={"a": 0.0}, maybe=None)
    assert replace(example, share=0.0).share == 0.0


def settings(cls: type, seen: set[type]) -> Iterator[type]:
    """The dataclass and all those within it."""
    if cls in seen:
        return
    seen.add(cls)
    yield cls
    for hint in get_type_hints(cls).values():
        for part in parts(hint):
            if isinstance(part, type) and is_dataclass(part):
                yield from settings(part, seen)


def parts(hint: Any) -> Iterator[Any]:
    """A type and those that it is made of, down to what has a range."""
    yield hint
    if get_origin(hint) is not Annotated:
        for argument in get_args(hint):
            yield from parts(argument)


def test_every_number_of_every_setting_has_a_range() -> None:
    classes: set[type] = set()
    for cls in (Spec, SweepSpec, *(method.settings for method in METHODS.values())):
        list(settings(cls, classes))
    numbers = 0
    for cls in classes:
        hints = get_type_hints(cls, include_extras=True)
        for field in fields(cls):
            name = f"{cls.__name__}.{field.name}"
            hint = hints[field.name]
            inner = get_args(hint)[1] if get_origin(hint) is dict else hint
            for part in parts(inner):
                assert name in ANYWHERE or part not in (int, float), f"{name} has no range"
                for bound in [one for one in get_args(part) if isinstance(one, Interval)]:
                    assert (bound.ge, bound.gt) != (None, None), f"{name} may be any small number"
                    assert (bound.le, bound.lt) != (None, None), f"{name} may be any large number"
                    numbers += 1
        if any(get_origin(part) is Annotated for hint in hints.values() for part in parts(hint)):
            assert issubclass(cls, Bounded), f"{cls.__name__} does not check its ranges"
    assert numbers > 60


@pytest.mark.parametrize("method", ["random-stitch", "mf-stitch", "mb-stitch", "reach-stitch"])
def test_a_stitch_limit_below_zero_is_refused(method: str) -> None:
    with pytest.raises(ValueError, match="limit: must be at least 0: -1"):
        METHODS[method].settings(limit=-1)  # type: ignore[call-arg]


def test_ranges_are_the_library_s() -> None:
    assert isinstance(get_args(Count)[1], Interval)
