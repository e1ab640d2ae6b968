import subprocess
import sys
from dataclasses import replace

import pytest

from analysis.schema import RunError, RunSpec, TableEntry
from analysis.tables.rows import ROW_RULES, check_tables, column_labels, place_tasks


def rows_of(spec: RunSpec, rows: str, noun: str = "skills") -> list[str]:
    table = TableEntry(id="t", paper="", rows=rows, title="", noun=noun)
    return place_tasks(spec, table)["row"].drop_duplicates().tolist()


def test_by_length(spec: RunSpec) -> None:
    assert rows_of(spec, "length", "goals") == ["2 goals", "3 goals", "4 goals"]
    assert rows_of(replace(spec, tasks=("g0",)), "length") == ["1 skill"]


def test_by_last_skill(spec: RunSpec) -> None:
    rows = rows_of(spec, "last_skill")
    assert len(rows) == 12
    assert rows[:5] == ["X → g0", "X → g1", "X → g2", "X → g3", "X → Y → g0"]
    assert rows[-1] == "X → Y → Z → g3"


def test_by_task(spec: RunSpec) -> None:
    few = replace(spec, tasks=("g2>g0>g1", "g1", "g3>g3"))
    assert rows_of(few, "task") == ["g1", "g3 → g3", "g2 → g0 → g1"]


def test_by_variant_names_the_method_without_it(spec: RunSpec) -> None:
    """Table 5: one row for each quality of the dataset."""
    levels = replace(
        spec,
        tasks=("g0>g1",),
        methods={
            f"{name}@{level}": label
            for level in ("level-1", "level-2")
            for name, label in (("no-stitch", "No-Stitch"), ("mb-stitch", "MB-Stitch"))
        },
    )
    table = TableEntry(id="t", paper="5", rows="variant", title="")
    places = place_tasks(levels, table)
    assert places["row"].tolist() == ["level-1", "level-1", "level-2", "level-2"]
    assert places["column"].tolist() == ["no-stitch", "mb-stitch"] * 2
    assert column_labels(levels) == {"no-stitch": "No-Stitch", "mb-stitch": "MB-Stitch"}


def test_an_unknown_rule_names_the_known_ones(spec: RunSpec) -> None:
    with pytest.raises(RunError, match="known are length, last_skill, task, variant"):
        rows_of(spec, "colour")


def test_tables_can_be_checked_before_anything_is_run() -> None:
    good = [TableEntry(id=rule, paper="", rows=rule, title="") for rule in ROW_RULES]
    check_tables(good)
    bad = TableEntry(id="mine", paper="", rows="colour", title="")
    with pytest.raises(RunError, match="table mine wants rows by 'colour'; known are length, last"):
        check_tables([*good, bad])


def test_the_check_costs_no_heavy_import() -> None:
    heavy = "{'numpy', 'pandas', 'matplotlib'}"
    code = f"import sys, analysis.tables.rows; print(*{heavy} & set(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not loaded.stdout.strip()
