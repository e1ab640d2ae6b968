"""Results kept with the code: none is lost to a smaller run, or to a folder that takes nothing."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis import open_run
from analysis.report import export_results
from analysis.results import SCALES, Extent, check_results, extent_of, provenance_text
from analysis.schema import RunError
from analysis.tables.writers import to_csv

RESULTS = Path(__file__).parents[2] / "results"

EXTENT: Extent = {"scale": "quick", "seeds": 2, "episodes": 10}


def test_scales_are_ranked_from_the_smallest() -> None:
    assert SCALES == ("smoke", "quick", "standard", "paper")


def kept(results: Path, extent: Extent) -> Path:
    folder = results / "table1"
    folder.mkdir(parents=True)
    (folder / "provenance.json").write_text(provenance_text({"cpu": "any"}, extent))
    return folder


@pytest.mark.parametrize(
    ("changes", "larger"),
    [
        ({}, ""),
        ({"scale": "paper", "seeds": 3, "episodes": 11}, ""),
        ({"tasks": 1}, ""),  # of which what is kept says nothing
        ({"scale": "smoke"}, "scale quick against smoke"),
        ({"scale": "paper", "seeds": 1}, "seeds 2 against 1"),
        ({"scale": "paper", "episodes": 9}, "episodes 10 against 9"),
    ],
    ids=str,
)
def test_what_is_larger_stays(tmp_path: Path, changes: dict[str, Any], larger: str) -> None:
    kept(tmp_path, EXTENT)
    asked = EXTENT | changes
    check_results(tmp_path, ["table1"], asked, force=True)
    check_results(tmp_path, ["table2"], asked, force=False)
    if larger:
        with pytest.raises(RunError, match=f"table1 holds more, {larger}.*--force"):
            check_results(tmp_path, ["table2", "table1"], asked, force=False)
    else:
        check_results(tmp_path, ["table1"], asked, force=False)


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"extent": {"scale": "huge"}}', '{"extent": {"seeds": [3]}}']
)
def test_what_cannot_be_read_is_not_replaced(tmp_path: Path, text: str) -> None:
    (kept(tmp_path, EXTENT) / "provenance.json").write_text(text)
    with pytest.raises(RunError, match=r"provenance\.json: .*move it away"):
        check_results(tmp_path, ["table1"], EXTENT, force=False)


def test_a_folder_that_takes_nothing_is_found_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for unusable in ("file", "file/results", "link", "link/results"):
        with pytest.raises(RunError, match="no folder that can be written to"):
            check_results(tmp_path / unusable, ["table1"], EXTENT, force=False)
    with pytest.raises(RunError, match="name too long"):
        check_results(tmp_path / ("a" * 300), ["table1"], EXTENT, force=False)
    check_results(tmp_path / "not" / "yet", ["table1"], EXTENT, force=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link"]


def test_an_export_is_read_like_the_run(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    run_dir = write_run(tmp_path / "run", training=None, showcase=None)
    (folder,) = export_results(run_dir, tmp_path / "results")
    ours, kept_ones = open_run(run_dir), open_run(folder)
    pd.testing.assert_frame_equal(kept_ones.episodes, ours.episodes)
    pd.testing.assert_frame_equal(kept_ones.scores("table1"), ours.scores("table1"))


def test_what_was_given_up_is_exported_too(tmp_path: Path, write_run: Any) -> None:
    """Without it a block that was given up would count as one that nobody survived to."""
    lost = [{"method": "mb-stitch", "seed": 2, "prefix": "g0>g1", "episodes": [3], "error": "x"}]
    run_dir = write_run(tmp_path / "run", training=None, showcase=None, quarantine=lost)
    (folder,) = export_results(run_dir, tmp_path / "results")
    ours, kept_ones = open_run(run_dir), open_run(folder)
    pd.testing.assert_frame_equal(kept_ones.episodes, ours.episodes)


@pytest.mark.parametrize("table", ["table1", "table1-reach", "table2-levels"])
def test_committed_results_give_their_own_numbers_again(table: str) -> None:
    """Whoever has the repository alone can work a table out from its segments."""
    folder = RESULTS / table
    run = open_run(folder)
    assert to_csv(run.scores(table)) == (folder / "scores.csv").read_text()
    assert to_csv(run.gains(table)) == (folder / "gains.csv").read_text()


def test_an_export_says_its_extent_and_keeps_to_it(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run_dir = write_run(tmp_path / "run", training=None, showcase=None)
    (folder,) = export_results(run_dir, tmp_path / "results")
    extent = extent_of(folder)
    assert extent == {"scale": "quick", "seeds": 3, "episodes": 10, "tasks": 60}
    (folder / "provenance.json").write_text(provenance_text({}, extent | {"seeds": 4}))
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    with pytest.raises(RunError, match="seeds 4 against 3"):
        export_results(run_dir, tmp_path / "results")
    assert before == {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    export_results(run_dir, tmp_path / "results", force=True)
    assert extent_of(folder) == extent


def test_the_same_results_again_change_no_file(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    """Whenever, wherever and by whichever revision they were made again."""
    made: list[dict[str, Any]] = [
        {"git_revision": revision, "written": date, "run_id": revision, "seconds": {"training": 1}}
        for revision, date in (("abc", "2026-01-01"), ("def", "2027-01-01"))
    ]
    runs = [
        write_run(tmp_path / one["run_id"], training=None, showcase=None, provenance=one)
        for one in made
    ]
    (folder,) = export_results(runs[0], tmp_path / "results")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    said = json.loads((folder / "provenance.json").read_text())
    assert said == {"git_revision": "abc", "extent": extent_of(folder)}
    export_results(runs[1], tmp_path / "results")
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_other_results_say_what_made_them(
    tmp_path: Path, write_run: Callable[..., Path], segments: pd.DataFrame
) -> None:
    other = segments.assign(steps=segments["steps"] + 1)
    runs = [
        write_run(tmp_path / name, one, training=None, showcase=None, provenance={"cpu": name})
        for name, one in (("a", segments), ("b", other))
    ]
    for run, name in zip(runs, "ab", strict=True):
        (folder,) = export_results(run, tmp_path / "results")
        assert json.loads((folder / "provenance.json").read_text())["cpu"] == name


def test_all_that_is_committed_says_how_much_it_is() -> None:
    folders = list(RESULTS.iterdir())
    assert len(folders) >= 8
    for folder in folders:
        provenance = json.loads((folder / "provenance.json").read_text())
        assert {"scale", "seeds", "episodes"} <= provenance["extent"].keys(), folder.name
