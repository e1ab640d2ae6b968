"""How tasks are gathered into the rows of a table: one function a way, registered by name.

Light to import, so that a spec can be checked before anything is run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Protocol

from analysis.schema import SEPARATOR, VARIANT, RunError, RunSpec, TableEntry, task_length

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, order=True)
class CellPlace:
    """Where a task played by a method is counted."""

    order: tuple[int, ...]  # rows are sorted by this
    row: str
    method: str


RowRule = Callable[[str, str, RunSpec, TableEntry], CellPlace]


def by_length(task: str, method: str, spec: RunSpec, table: TableEntry) -> CellPlace:
    """Tables 1 and 2: "2 goals"."""
    length = task_length(task)
    noun = table.noun.removesuffix("s") if length == 1 else table.noun
    return CellPlace((length,), f"{length} {noun}", method)


def by_last_skill(task: str, method: str, spec: RunSpec, table: TableEntry) -> CellPlace:
    """Table 8: "X → Y → kettle", where X and Y stand for any other skills."""
    *before, last = task.split(SEPARATOR)
    names = [f"X{i}" for i in range(1, len(before) + 1)] if len(before) > 3 else list("XYZ")
    row = " → ".join([*names[: len(before)], spec.skill_label(last)])
    return CellPlace((len(before) + 1, spec.skills.index(last)), row, method)


def by_task(task: str, method: str, spec: RunSpec, table: TableEntry) -> CellPlace:
    """Tables 3, 4 and 9: every task is a row."""
    return CellPlace((task_length(task), spec.tasks.index(task)), spec.task_label(task), method)


def by_variant(task: str, method: str, spec: RunSpec, table: TableEntry) -> CellPlace:
    """Table 5: "level-1", from methods named "mb-stitch@level-1"."""
    base, _, variant = method.partition(VARIANT)
    variants = list(dict.fromkeys(name.partition(VARIANT)[2] for name in spec.methods))
    return CellPlace((variants.index(variant),), variant, base)


ROW_RULES: dict[str, RowRule] = {
    "length": by_length,
    "last_skill": by_last_skill,
    "task": by_task,
    "variant": by_variant,
}


class NamesItsRows(Protocol):
    """A table as a spec asks for it."""

    @property
    def id(self) -> str: ...

    @property
    def rows(self) -> str: ...


def check_tables(tables: Iterable[NamesItsRows]) -> None:
    """Raises RunError, listing what is known, for a table whose rows cannot be made."""
    for table in tables:
        if table.rows not in ROW_RULES:
            raise RunError(
                f"table {table.id} wants rows by {table.rows!r}; known are {', '.join(ROW_RULES)}"
            )


def place_tasks(spec: RunSpec, table: TableEntry) -> pd.DataFrame:
    """Every (task, method) with its cell: columns task, method, row, column, sorted by row.

    `column` is the method as the table calls it, in the order of the spec's methods.
    """
    import pandas as pd

    check_tables([table])
    rule = ROW_RULES[table.rows]
    asked = {pair for part in spec.by_part for pair in product(part.methods, part.tasks)}
    places = [
        (rule(task, method, spec, table), task, method)
        for method, task in product(spec.methods, spec.tasks)
        if (method, task) in asked
    ]
    places.sort(key=lambda place: place[0].order)
    return pd.DataFrame(
        [(task, method, place.row, place.method) for place, task, method in places],
        columns=["task", "method", "row", "column"],
    )


def column_labels(spec: RunSpec) -> dict[str, str]:
    """The methods as tables call them -> their labels, without what they were trained on."""
    labels: dict[str, str] = {}
    for name, label in spec.methods.items():
        labels.setdefault(name.partition(VARIANT)[0], label.partition(VARIANT)[0].strip())
    return labels
