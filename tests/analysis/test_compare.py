from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.compare import (
    COLUMNS,
    NothingToCompareError,
    compare,
    comparison_markdown,
    settings_apart,
    settings_markdown,
)
from analysis.tables.writers import seed_note
from tests.rows import row


@pytest.fixture
def run_a(tmp_path: Path, write_run: Callable[..., Path]) -> Path:
    return write_run(tmp_path / "a")


def test_a_run_equals_itself(run_a: Path) -> None:
    comparison = compare(run_a, run_a)
    assert comparison.columns.tolist() == COLUMNS
    assert len(comparison) == 12
    assert (comparison[["b_minus_a", "ci_low", "ci_high"]] == 0).all(axis=None)
    assert comparison["pairs"].tolist() == [360] * 4 + [720] * 8


def test_a_difference_is_found_and_paired(
    run_a: Path, tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    worse = segments.copy()
    worse.loc[(worse["method"] == "mb-stitch") & (worse["depth"] == 2), "success"] = False
    run_b = write_run(tmp_path / "b", segments=worse)
    comparison = compare(run_a, run_b).set_index(["row", "method"])
    assert comparison.loc[("2 goals", "mb-stitch"), "score_b"] == 0.5
    changed = row(comparison, "2 goals", "mb-stitch")
    assert changed["b_minus_a"] == pytest.approx(changed["score_b"] - changed["score_a"])
    assert changed["ci_high"] < -0.4
    assert comparison.loc[("2 goals", "no-stitch"), "b_minus_a"] == 0
    text = comparison_markdown(comparison.reset_index(), "a", "b")
    assert "| A: a | B: b | B − A |" in text
    assert f"| 0.500 | {changed['b_minus_a']:+.3f} |" in text
    assert sum(line.endswith("| apart |") for line in text.splitlines()) == 3


def test_only_common_episodes_count(
    run_a: Path, tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    run_b = write_run(tmp_path / "b", segments=segments.query("seed < 2 and episode < 5"))
    comparison = compare(run_a, run_b)
    assert comparison["pairs"].tolist() == [12 * 2 * 5] * 4 + [24 * 2 * 5] * 8
    assert set(comparison["seeds"]) == {2}
    assert seed_note(2) in comparison_markdown(comparison, "a", "b")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"seeds": [7, 8]}, r"no seed in common \(0, 1, 2 against 7, 8\)"),
        ({"methods": [{"name": "other"}]}, "no method in common"),
        ({"tasks": ["g0"]}, "no task in common"),
    ],
)
def test_says_why_nothing_can_be_compared(
    run_a: Path,
    tmp_path: Path,
    spec_dict: Callable[..., dict[str, Any]],
    write_run: Callable[..., Path],
    change: Any,
    reason: str,
) -> None:
    run_b = write_run(tmp_path / "b", spec={**spec_dict(), **change})
    with pytest.raises(NothingToCompareError, match=reason):
        compare(run_a, run_b)


ASKED = {
    "benchmark": "maze",
    "root_seed": 0,
    "mb_stitch": {"alpha": 1.0, "cem": {"horizon": 5}},
    "tables": [{"id": "table1", "paper": "1"}],
}


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ({"root_seed": 7}, "the root seeds of maze differ, 0 in table1 and 7 in table1"),
        ({"benchmark": "kitchen"}, "table1 is played in maze, table1 in kitchen"),
    ],
    ids=["root seed", "benchmark"],
)
def test_other_random_numbers_are_not_paired(
    tmp_path: Path,
    spec_dict: Callable[..., dict[str, Any]],
    write_run: Callable[..., Path],
    what: dict[str, Any],
    message: str,
) -> None:
    """Between runs, between merged runs, and between a run and a merged one."""
    asked = [(plain, {"parts": [{"label": "x", "spec": plain}]}) for plain in (ASKED, ASKED | what)]
    runs = [
        [
            write_run(tmp_path / f"{side}{n}", spec=spec_dict() | {"spec": spec})
            for n, spec in enumerate(both)
        ]
        for side, both in enumerate(asked)
    ]
    for run_a in runs[0]:
        for run_b in runs[1]:
            with pytest.raises(NothingToCompareError, match=message):
                compare(run_a, run_b)
        assert len(compare(run_a, runs[0][0])) == 12


def test_fields_that_differ_are_listed(
    tmp_path: Path, spec_dict: Callable[..., dict[str, Any]], write_run: Callable[..., Path]
) -> None:
    other = ASKED | {"mb_stitch": {"alpha": 5.0, "cem": {"horizon": 5}}, "new": True}
    run_a = write_run(tmp_path / "a", spec=spec_dict() | {"spec": ASKED})
    run_b = write_run(tmp_path / "b", spec=spec_dict() | {"spec": other})
    apart = settings_apart(run_a, run_b)
    assert apart.to_numpy().tolist() == [["mb_stitch.alpha", 1.0, 5.0], ["new", "–", True]]
    text = settings_markdown(apart, "a", "b")
    assert "| mb_stitch.alpha | 1.0 | 5.0 |" in text
    assert text.startswith("“–”: that run has no such field")
    same = settings_markdown(settings_apart(run_a, run_a), "a", "a")
    assert same == "Both runs were asked for the same.\n"


def test_an_unfinished_run_has_nothing_yet(
    run_a: Path, tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    run_b = write_run(tmp_path / "b", segments=segments.query("depth == 1"))
    with pytest.raises(NothingToCompareError, match="resume the one that is incomplete"):
        compare(run_a, run_b)


def test_what_one_run_gave_up_is_compared_in_neither(
    run_a: Path, tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    block = {"method": "mb-stitch", "seed": 0, "prefix": "g0>g1", "episodes": [0, 1, 2]}
    run_b = write_run(tmp_path / "b", quarantine=[block])
    pairs = compare(run_a, run_b).set_index(["row", "method"])["pairs"]
    assert pairs["2 goals", "mb-stitch"] == pairs["2 goals", "no-stitch"] - 3
    assert pairs["4 goals", "mb-stitch"] == pairs["4 goals", "no-stitch"] - 2 * 3
