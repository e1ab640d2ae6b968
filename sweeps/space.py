"""The search space: fields of a run spec, and the values that each may take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)

from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec, spec_from_plain
from orchestrator.spec.structure import Plain, merged, nested, to_plain
from stitching.bounds import Bounded, FewOrNone

Value = int | float | bool | str
Fields = dict[str, Value]  # path in a run spec, as "mb_stitch.cem.population", → value

MOST_CORNERS = 512


@dataclass(frozen=True)
class Dimension(Bounded):
    """One searched field: either some `choices`, or all numbers from `low` to `high`."""

    choices: tuple[Value, ...] = ()
    low: int | float | None = None
    high: int | float | None = None
    log: bool = False  # search, or lay the grid, on a logarithmic scale
    integer: bool = False
    points: FewOrNone = 0  # of the grid, from low to high

    def check(self, where: str) -> None:
        """UsageError says what is wrong with the range."""
        if self.choices:
            if self.low is not None or self.high is not None:
                raise UsageError(f"{where}: give choices, or low and high, not both")
            return
        if self.low is None or self.high is None:
            raise UsageError(f"{where}: give choices = […], or low and high")
        if not self.low < self.high:
            raise UsageError(f"{where}: low must be below high: {self.low}, {self.high}")
        if self.log and self.low <= 0:
            raise UsageError(f"{where}: a logarithmic range needs low > 0: {self.low}")
        if self.integer and not (isinstance(self.low, int) and isinstance(self.high, int)):
            raise UsageError(f"{where}: low and high must be whole: {self.low}, {self.high}")

    @property
    def ends(self) -> tuple[Value, ...]:
        """The values that are tried before anything runs."""
        if self.choices:
            return self.choices
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    def grid(self, where: str) -> list[Value]:
        """Every value that a grid visits."""
        if self.choices:
            return list(self.choices)
        if self.points < 2:
            raise UsageError(f"{where}: a grid needs choices = […], or points = 2 or more")
        space = np.geomspace if self.log else np.linspace
        values = space(float(self.low or 0), float(self.high or 0), self.points)
        if self.integer:
            return sorted({round(float(value)) for value in values})
        return [float(f"{value:.6g}") for value in values]

    @property
    def distribution(self) -> BaseDistribution:
        """The same as Optuna says it."""
        if self.choices:
            return CategoricalDistribution(self.choices)
        assert self.low is not None
        assert self.high is not None
        if self.integer:
            return IntDistribution(int(self.low), int(self.high), log=self.log)
        return FloatDistribution(float(self.low), float(self.high), log=self.log)

    def holds(self, value: Value) -> bool:
        """Whether a value lies in here."""
        if self.choices:
            return any(value == choice and type(value) is type(choice) for choice in self.choices)
        number = isinstance(value, int | float) and not isinstance(value, bool)
        assert self.low is not None
        assert self.high is not None
        return number and self.low <= value <= self.high  # type: ignore[operator]


Space = dict[str, Dimension]


def check_space(space: Space, spec: Spec, parts: Sequence[str], where: str) -> None:
    """Build the spec at the corners of the space, so that no trial can be refused later.

    parts of a spec are what a trial may change: others say which episodes are compared, or change
    nothing that is played. UsageError names the field and what is valid.
    """
    if not space:
        raise UsageError(f"{where}: nothing to search; as space.'mb_stitch.alpha' = {{ … }}")
    for path, dimension in space.items():
        if path.split(".")[0] not in parts:
            raise UsageError(
                f"{where}: {path!r} cannot be searched; begin with one of {', '.join(parts)}"
            )
        dimension.check(f"{where}, {path}")
    lowest = {path: dimension.ends[0] for path, dimension in space.items()}
    for path, dimension in space.items():
        for value in dimension.ends:
            replaced(spec, lowest | {path: value}, f"{where}, {path} = {value!r}")
    corners = product(*(dimension.ends for dimension in space.values()))
    for _, corner in zip(range(MOST_CORNERS), corners, strict=False):
        fields = dict(zip(space, corner, strict=True))
        replaced(spec, fields, f"{where}, at {describe(fields)}")


def check_enqueued(enqueued: Sequence[Fields], space: Space, where: str) -> None:
    """UsageError for a trial that does not say each field of the space, within its range."""
    for number, fields in enumerate(enqueued):
        if fields.keys() != space.keys():
            raise UsageError(f"{where}, {number}: expected a value for each of {', '.join(space)}")
        for path, value in fields.items():
            if not space[path].holds(value):
                raise UsageError(f"{where}, {number}, {path}: {value!r} is outside its range")


def grid_points(space: Space, where: str) -> list[Fields]:
    """All combinations, the last field varying fastest."""
    values = [dimension.grid(f"{where}, {path}") for path, dimension in space.items()]
    return [dict(zip(space, point, strict=True)) for point in product(*values)]


def replaced(spec: Spec, fields: Fields, where: str) -> Spec:
    """The spec with some fields changed; UsageError for an unknown field or a bad value."""
    return spec_from_plain(merged(to_plain(spec), nested(dict(fields))), where)


def current(spec: Spec, path: str) -> Value | None:
    """The spec's own value of a field; None of an entry that a table of it has not."""
    *above, name = path.split(".")
    table: Plain = to_plain(spec)
    for part in above:
        table = table[part]
    return table.get(name)


def describe(fields: Fields) -> str:
    """ "alpha 3.2, cem.population 80": for a person; the method's own prefix is understood."""
    return ", ".join(
        f"{path.removeprefix('mb_stitch.')} {short(value)}" for path, value in fields.items()
    )


def short(value: Value) -> str:
    """A value as tables print it."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
