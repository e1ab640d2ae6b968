import io
from dataclasses import replace

import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.schema import RunSpec
from analysis.tables.table import SCORE_COLUMNS, Table, build_table
from analysis.tables.writers import describe, latex, seed_note, to_csv, to_latex, to_markdown


@pytest.fixture(scope="module")
def episodes(segments: pd.DataFrame, spec: RunSpec) -> pd.DataFrame:
    return episodes_from_segments(segments, spec)


@pytest.fixture(scope="module")
def table(episodes: pd.DataFrame, spec: RunSpec) -> Table:
    return build_table(episodes, spec, spec.tables[0])


@pytest.fixture(scope="module")
def partial(episodes: pd.DataFrame, spec: RunSpec) -> Table:
    short = episodes.query("not (method == 'mf-stitch' and length == 3 and episode > 7)")
    return build_table(short, spec, spec.tables[0])


def test_markdown_puts_the_paper_beside_ours(table: Table) -> None:
    text = to_markdown(table)
    assert "| Task | No-Stitch | Random-Stitch | MF-Stitch | MB-Stitch |" in text
    assert "paper 0.986 ± 0.000 · agrees" in text
    assert "Scale: quick. 3 seeds (0, 1, 2), 10 episodes" in text
    assert "Partial" not in text
    widths = {line.count(" | ") for line in text.splitlines() if line.startswith("| 2 goals | 0")}
    assert widths == {4}


def test_a_partial_table_says_so_with_exact_counts(partial: Table) -> None:
    assert describe(partial)[0].startswith("Partial table: 7,056 of 7,200 episodes are there")
    assert "n = 576 of 720" in to_markdown(partial)
    assert "n = 576 of 720" in to_latex(partial)


def test_rows_of_other_tasks_stand_alone(episodes: pd.DataFrame, spec: RunSpec) -> None:
    few = replace(spec, tasks=("g0>g1",))
    table = build_table(episodes, few, spec.tables[0])
    assert table.other_tasks == {"2 goals": (1, 12)}
    text = to_markdown(table)
    assert "2 goals (1 here, 12 there)" in text
    assert "paper 0.986" not in text


def test_as_many_tasks_as_the_paper_s_are_not_the_paper_s(
    episodes: pd.DataFrame, spec: RunSpec
) -> None:
    """Twelve of two goals, one of which comes twice."""
    pairs = [task for task in spec.tasks if task.count(">") == 1]
    repeated = ["g0>g0" if task == "g1>g0" else task for task in pairs]
    renamed = episodes.assign(task=episodes["task"].replace("g1>g0", "g0>g0"))
    table = build_table(renamed, replace(spec, tasks=tuple(repeated)), spec.tables[0])
    assert table.other_tasks == {"2 goals": (12, 12)}
    assert table.leads.empty
    assert "paper 0.986" not in to_markdown(table)


@pytest.mark.parametrize(
    ("task", "alone"), [("open door>close door", 0), ("close door>open door", 4)]
)
def test_a_row_that_is_a_variant_is_of_the_paper_s_task(
    episodes: pd.DataFrame, spec: RunSpec, task: str, alone: int
) -> None:
    """Table 5's levels name no task, so the row's label does not tell."""
    methods = {f"no-stitch@level-{n}": f"No-Stitch @level-{n}" for n in (1, 2, 3, 4)}
    parts = replace(spec, tasks=(task,), methods=methods, skills=tuple(task.split(">")), parts=())
    entry = replace(spec.tables[0], paper="5", rows="variant")
    assert len(build_table(episodes, parts, entry).other_tasks) == alone


def test_a_smoke_run_shows_the_papers_numbers_without_a_verdict(table: Table) -> None:
    text = to_markdown(replace(table, spec=replace(table.spec, scale="smoke")))
    assert "paper 0.986 ± 0.000 |" in text
    assert "agrees" not in text
    assert "claims" not in text


def test_csv_reads_back(table: Table) -> None:
    read = pd.read_csv(io.StringIO(to_csv(table.scores)))
    assert read.columns.tolist() == SCORE_COLUMNS
    pd.testing.assert_frame_equal(read, table.scores, atol=1e-6, check_dtype=False)


def test_latex_is_balanced_booktabs(table: Table) -> None:
    text = to_latex(table)
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert text.count(rule) == 1
    assert text.count("{") == text.count("}")
    rows = text.split(r"\midrule")[1].split(r"\bottomrule")[0].strip().splitlines()
    assert len(rows) == 9
    assert {row.count("&") for row in rows} == {4}


def test_latex_escapes() -> None:
    assert latex("50 % of a_b → {c}") == r"50 \% of a\_b $\rightarrow$ \{c\}"


@pytest.mark.parametrize(
    ("seeds", "words"),
    [
        (1, "not other training runs"),
        (2, "nearer to 50 %"),
        (3, "nearer to 75 %"),
        (7, "only 7 seeds the intervals are rough, and if anything too narrow"),
        (20, "rest on 20 seeds"),
    ],
)
def test_the_number_of_seeds_is_spoken_of(seeds: int, words: str) -> None:
    assert words in seed_note(seeds)


def test_while_only_one_seed_is_played_the_table_speaks_of_one(
    episodes: pd.DataFrame, spec: RunSpec
) -> None:
    begun = build_table(episodes.query("seed == 1 or length == 2"), spec, spec.tables[0])
    text = to_markdown(begun)
    assert seed_note(1) in text
    assert "not all have 3 seeds" in text
    assert "holds for these models" in text
    assert text.count("**holds**") == 1  # of the row that has all three


def test_bytes_are_reproducible(table: Table, episodes: pd.DataFrame, spec: RunSpec) -> None:
    shuffled = episodes.sample(frac=1, random_state=0)
    again = build_table(shuffled, spec, spec.tables[0])
    assert to_markdown(again) == to_markdown(table)
    assert to_csv(again.gains) == to_csv(table.gains)
    assert to_latex(again) == to_latex(table)


def test_empty_cells_are_dashes(episodes: pd.DataFrame, spec: RunSpec) -> None:
    empty = build_table(episodes.query("method != 'mb-stitch'"), spec, spec.tables[0])
    assert "–<br>paper 0.986 ± 0.000<br>n = 0 of 360" in to_markdown(empty)
    assert "nan" not in to_markdown(empty) + to_latex(empty)


def test_a_table_without_a_paper_has_no_verdicts(table: Table) -> None:
    ours = replace(table, scores=table.scores.assign(paper_score=float("nan")))
    assert "· agrees" not in to_markdown(ours)
