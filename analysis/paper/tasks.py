"""The tasks that the rows of the paper's tables are means over."""

from collections.abc import Iterator
from itertools import permutations

from analysis.paper.numbers import paper_table

ARROW = " → "
GOALS = ("g0", "g1", "g2", "g3")  # Table 1's
OPEN_AND_CLOSE = ARROW.join(("open door", "close door"))  # of every row of Table 5


def paper_tasks(number: str) -> dict[str, frozenset[str]]:
    """Row of a table → its tasks, each as tables write it: "kettle → top burner".

    In Tables 1 and 2 all permutations of that length, in Table 8 those that end with its skill, in
    Table 5 always the same one; elsewhere a row is its task.
    """
    rows = dict.fromkeys(paper_table(number)["row"])
    return {row: frozenset(_tasks(number, row)) for row in rows}


def _tasks(number: str, row: str) -> Iterator[str]:
    if number in ("1", "2"):
        skills = GOALS if number == "1" else kitchen_skills()
        yield from map(ARROW.join, permutations(skills, int(row.split()[0])))
    elif number == "8":
        *before, last = row.split(ARROW)
        others = [skill for skill in kitchen_skills() if skill != last]
        yield from (ARROW.join((*some, last)) for some in permutations(others, len(before)))
    else:
        yield OPEN_AND_CLOSE if number == "5" else row


def kitchen_skills() -> list[str]:
    """Those of Tables 2 and 8, as the latter's rows name them."""
    return list(dict.fromkeys(row.split(ARROW)[-1] for row in paper_table("8")["row"]))
