"""Which tasks the paper's numbers are means over."""

import pytest

from analysis.paper.numbers import paper_table
from analysis.paper.tasks import kitchen_skills, paper_tasks


@pytest.mark.parametrize("number", ["1", "2", "3", "4", "5", "8", "9"])
def test_a_row_has_as_many_tasks_as_the_paper_says(number: str) -> None:
    cells = paper_table(number)
    counts = dict(zip(cells["row"], cells["tasks"], strict=True))
    assert {row: len(tasks) for row, tasks in paper_tasks(number).items()} == counts


def test_tasks_are_as_tables_write_them() -> None:
    assert "g3 → g0" in paper_tasks("1")["2 goals"]
    assert paper_tasks("3")["can → can"] == {"can → can"}
    assert paper_tasks("5")["level-2"] == {"open door → close door"}
    assert len(kitchen_skills()) == 7
    ending = paper_tasks("8")["X → Y → kettle"]
    assert "top burner → microwave → kettle" in ending
    assert not any("kettle → " in task for task in ending)


def test_a_table_that_is_not_the_paper_s_has_none() -> None:
    assert paper_tasks("") == {}
