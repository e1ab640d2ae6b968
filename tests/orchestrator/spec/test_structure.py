"""Dataclasses from plain data: strict about every field, and back again without loss."""

from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from orchestrator.errors import UsageError
from orchestrator.spec.structure import structure, to_plain


@dataclass(frozen=True)
class Inner:
    width: int = 1
    rate: float = 0.5


@dataclass(frozen=True)
class Outer:
    name: str
    kind: Literal["a", "b"] = "a"
    flag: bool = False
    inner: Inner = Inner()
    numbers: tuple[int, ...] = ()
    limits: dict[int, int] = field(default_factory=dict)
    maybe: int | None = None


PLAIN = {
    "name": "x",
    "kind": "b",
    "flag": True,
    "inner": {"width": 3, "rate": 2},
    "numbers": [1, 2],
    "limits": {"2": 50},
    "maybe": 7,
}


def test_there_and_back() -> None:
    outer = structure(Outer, PLAIN, "test")
    assert outer == Outer("x", "b", True, Inner(3, 2.0), (1, 2), {2: 50}, 7)
    assert structure(Outer, to_plain(outer), "test") == outer


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nmae": 1}, "unknown field 'nmae'; valid are name, kind, flag"),
        ({"inner": {"witdh": 1}}, "inner: unknown field 'witdh'; valid are width, rate"),
        ({"kind": "c"}, "kind: 'c' is not one of a, b"),
        ({"flag": 1}, "flag: expected bool"),
        ({"inner": {"width": 1.5}}, "width: expected int"),
        ({"inner": {"width": True}}, "width: expected int"),
        ({"inner": {"rate": "fast"}}, "rate: expected float"),
        ({"numbers": "12"}, "numbers: expected a list"),
        ({"numbers": [1, "2"]}, r"numbers\[1\]: expected int"),
        ({"limits": {"two": 50}}, "limits: key 'two' is not int"),
        ({"maybe": "7"}, "maybe: expected int"),
        ({"inner": 3}, "inner: expected a table"),
    ],
)
def test_what_does_not_fit_is_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=f"^a spec.*{message}"):
        structure(Outer, PLAIN | change, "a spec")


def test_a_missing_field_is_named() -> None:
    with pytest.raises(UsageError, match="field 'name' is missing"):
        structure(Outer, {}, "a spec")
