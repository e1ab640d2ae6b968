import numpy as np
import pandas as pd
import pytest

from analysis.paper.numbers import paper_table
from analysis.paper.orders import OTHER, SAME, order_of
from analysis.paper.verdicts import FAILS, HOLDS, claims
from analysis.schema import RunSpec
from analysis.tables.table import build_table

TASKS = {row.replace(" → ", ">"): row for row in dict.fromkeys(paper_table("4")["row"])}


def test_the_paper_s_rows_by_order() -> None:
    """Single-Policy leads the long task's beginnings there, and no other row."""
    cells = paper_table("4").set_index(["method", "row"])["score"]
    leads = cells["single-policy"] > cells["mb-stitch"]
    assert {row for row in leads.index if order_of(row) == SAME} == set(leads.index[leads])
    assert [order_of(row) for row in TASKS.values()].count(OTHER) == 10


LONG_TASK = "microwave>kettle>bottom burner>light switch"


def spec_of(long_task: str) -> RunSpec:
    return RunSpec.from_dict(
        {
            "name": "table4",
            "benchmark": "kitchen",
            "scale": "quick",
            "skills": ["bottom burner", "light switch", "microwave", "kettle"],
            "methods": [
                {"name": "single-policy", "label": "Single-Policy"},
                {"name": "mb-stitch", "label": "MB-Stitch"},
            ],
            "seeds": [0, 1],
            "episodes": 5,
            "tasks": list(TASKS),
            "step_limits": {"1": 120, "2": 250, "3": 360, "4": 480},
            "tables": [{"id": "table4", "paper": "4", "rows": "task", "title": ""}],
            "spec": {"single_policy": {"task": long_task}},
        }
    )


@pytest.fixture
def spec() -> RunSpec:
    return spec_of(LONG_TASK)


def as_printed(spec: RunSpec, order: str) -> pd.DataFrame:
    """Single-Policy does all of the tasks in this order, MB-Stitch of the others."""
    records = [
        (seed, method, task, task.count(">") + 1, episode, leads * (task.count(">") + 1))
        for seed in spec.seeds
        for method in spec.methods
        for task, row in TASKS.items()
        for episode in range(spec.episodes)
        for leads in [(order_of(row) == order) == (method == "single-policy")]
    ]
    columns = ["seed", "method", "task", "length", "episode", "accomplished"]
    frame = pd.DataFrame(records, columns=columns)
    return frame.assign(score=frame["accomplished"] / frame["length"], steps=np.int64(9))


def test_claims_of_table_4(spec: RunSpec) -> None:
    table = build_table(as_printed(spec, SAME), spec, spec.tables[0])
    first, second, *rows = claims(table)
    assert (first.text, first.verdict) == ("same order → Single-Policy leads", HOLDS)
    assert (second.text, second.verdict) == ("other orders → MB-Stitch leads", HOLDS)
    assert "over MB-Stitch, on average over these tasks (2 seeds, 40 paired" in first.detail
    assert len(rows) == 13  # the paper has a tie where the light switch is alone
    assert all(claim.verdict == HOLDS for claim in rows)


def test_claims_fail_where_the_other_leads(spec: RunSpec) -> None:
    table = build_table(as_printed(spec, OTHER), spec, spec.tables[0])
    assert [claim.verdict for claim in claims(table)] == [FAILS] * 15


@pytest.mark.parametrize("long_task", ["microwave>bottom burner>kettle>light switch", ""])
def test_orders_are_claimed_of_the_paper_s_long_task_alone(long_task: str) -> None:
    other = spec_of(long_task)
    table = build_table(as_printed(other, SAME), other, other.tables[0])
    assert table.orders.empty
    assert len(claims(table)) == 13, "of the rows, as in any table"
