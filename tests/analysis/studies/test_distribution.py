from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.schema import RunSpec
from analysis.studies.distribution import (
    ONE_SEED,
    SOME_OF_ONE_SEED,
    distribution_header,
    distribution_lines,
    distribution_note,
    distribution_table,
)
from analysis.tables.table import Table, build_table


@pytest.fixture(scope="module")
def table(segments: pd.DataFrame, spec: RunSpec) -> Table:
    return build_table(episodes_from_segments(segments, spec), spec, spec.tables[0])


def test_a_cell_is_worked_out_from_its_episodes(
    table: Table, segments: pd.DataFrame, spec: RunSpec
) -> None:
    episodes = episodes_from_segments(segments, spec).query("method == 'mb-stitch' and length == 3")
    runs = episodes.groupby(["seed", "task"])["score"].mean().sort_values().to_numpy()
    found = distribution_table(table).query("row == '3 goals' and method == 'mb-stitch'")
    cell = found.iloc[0]
    quarter = len(runs) // 4
    assert cell["iqm"] == pytest.approx(runs[quarter:-quarter].mean())
    assert cell["mean"] == pytest.approx(runs.mean())
    assert (cell["tasks"], cell["seeds"]) == (24, 3)
    assert cell["ci_low"] <= cell["iqm"] <= cell["ci_high"]


def test_rows_of_few_tasks_have_none(table: Table, spec: RunSpec) -> None:
    few = replace(table, task_scores=table.task_scores.query("row != '2 goals' or task < 'g1'"))
    assert list(dict.fromkeys(distribution_table(few)["row"])) == ["3 goals", "4 goals"]


def test_a_task_that_a_seed_lacks_is_left_out(table: Table) -> None:
    lacking = table.task_scores.query(
        "not (row == '4 goals' and seed == 1 and task == 'g0>g1>g2>g3' and method == 'no-stitch')"
    )
    lacking_table = replace(table, task_scores=lacking)
    found = distribution_table(lacking_table)
    tasks = found.set_index(["row", "method"])["tasks"]
    assert tasks["4 goals", "no-stitch"] == 23
    assert tasks["4 goals", "mb-stitch"] == 24
    kept = lacking.query("row == '4 goals' and method == 'no-stitch' and task != 'g0>g1>g2>g3'")
    means = found.set_index(["row", "method"])["mean"]
    assert means["4 goals", "no-stitch"] == pytest.approx(kept["score"].mean())
    rows = [line[0] for line in distribution_lines(lacking_table, found)]
    assert rows == ["2 goals (12 tasks)", "3 goals (24 tasks)", "4 goals (23 to 24 tasks)"]


def test_as_text(table: Table) -> None:
    found = distribution_table(table)
    assert distribution_header(table) == ["Task", *table.labels.values()]
    lines = distribution_lines(table, found)
    assert [line[0] for line in lines] == [
        "2 goals (12 tasks)", "3 goals (24 tasks)", "4 goals (24 tasks)",
    ]  # fmt: skip
    cell = found.iloc[0]
    assert lines[0][1] == f"{cell['iqm']:.3f} [{cell['ci_low']:.3f}, {cell['ci_high']:.3f}]"
    assert "3 seeds" in distribution_note(found)


def test_one_seed_is_said_to_have_no_interval(segments: pd.DataFrame, spec: RunSpec) -> None:
    alone = replace(spec, seeds=(0,))
    table = build_table(episodes_from_segments(segments, alone), alone, spec.tables[0])
    found = distribution_table(table)
    assert np.isnan(found["ci_low"]).all()
    assert "[" not in "".join(distribution_lines(table, found)[0])
    assert ONE_SEED in distribution_note(found)


def test_cells_of_one_seed_beside_others_are_said_to_have_no_interval(table: Table) -> None:
    assert SOME_OF_ONE_SEED not in distribution_note(distribution_table(table))
    alone = table.task_scores.query("method != 'no-stitch' or seed == 0")
    note = distribution_note(distribution_table(replace(table, task_scores=alone)))
    assert ONE_SEED not in note
    assert "3 seeds" in note
    assert note.endswith(SOME_OF_ONE_SEED)
