import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis import report
from analysis.report import build_report, export_results


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path]) -> Path:
    return write_run(tmp_path_factory.mktemp("report") / "run")


@pytest.fixture(scope="module")
def exported(run_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    results = tmp_path_factory.mktemp("results")
    export_results(run_dir, results)
    return results


def test_exports_what_is_kept_with_the_code(exported: Path) -> None:
    names = set(contents(exported / "table1"))
    assert {"scores.csv", "gains.csv", "table.md", "table.tex", "provenance.json"} <= names
    assert {"figures/table1-scores.svg", "figures/showcase.png"} <= names
    assert json.loads((exported / "table1" / "provenance.json").read_text())["versions"]


def test_the_same_run_gives_the_same_bytes(
    run_dir: Path,
    exported: Path,
    tmp_path: Path,
    segments: pd.DataFrame,
    write_run: Callable[..., Path],
) -> None:
    """Wherever the run lies, and in whatever order its segments were written."""
    elsewhere = write_run(tmp_path / "other", segments=segments[::-1])
    export_results(elsewhere, tmp_path / "results")
    assert contents(tmp_path / "results") == contents(exported)
    assert contents(elsewhere / "report") == contents(run_dir / "report")


def test_the_page_is_self_contained(run_dir: Path, exported: Path) -> None:
    page = (run_dir / "report" / "index.html").read_text(encoding="utf-8")
    assert "$" not in page.split("<script")[0].replace("${", "")
    for reference in ('src="http', 'href="http', "@import", "url("):
        assert reference not in page
    assert str(run_dir) not in page


def test_a_partial_run_is_reported_as_such(
    tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    """Quarantined blocks are named; without the optional files the page simply lacks parts."""
    lost = segments.query("not (method == 'mb-stitch' and prefix == 'g0>g1' and seed == 2)")
    block = {
        "method": "mb-stitch",
        "seed": 2,
        "prefix": "g0>g1",
        "episodes": list(range(10)),
        "error": "planner <diverged> & stopped",
    }
    run_dir = write_run(
        tmp_path / "run", segments=lost, quarantine=[block], training=None, showcase=None
    )
    page = build_report(run_dir).read_text(encoding="utf-8")
    assert "without any of the block's episodes" in page
    assert "Partial table: 7,150 of 7,200 episodes" in page
    assert "planner &lt;diverged&gt; &amp; stopped" in page
    assert "n = 350 of 360" in page
    assert not (run_dir / "report" / "figures" / "curves.svg").exists()


def test_the_old_results_stay_until_the_new_are_whole(
    tmp_path: Path, write_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    run_dir = write_run(tmp_path / "run", training=None, showcase=None)
    export_results(run_dir, tmp_path / "results")
    (tmp_path / "results" / "table1" / "stale.txt").touch()
    before = contents(tmp_path)

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    for last_step in ("render_page", "_copy_table"):
        with monkeypatch.context() as patch:
            patch.setattr(report, last_step, interrupted)
            with pytest.raises(KeyboardInterrupt):
                export_results(run_dir, tmp_path / "results")
        assert contents(tmp_path) == before
    export_results(run_dir, tmp_path / "results")
    assert before.keys() - contents(tmp_path).keys() == {"results/table1/stale.txt"}


def test_a_run_that_has_only_begun_can_be_reported(
    tmp_path: Path, segments: pd.DataFrame, write_run: Callable[..., Path]
) -> None:
    begun = segments.query("depth == 1 and seed == 0")
    page = build_report(write_run(tmp_path / "run", segments=begun)).read_text(encoding="utf-8")
    assert "Partial table: 0 of 7,200 episodes" in page
    assert pd.read_parquet(tmp_path / "run" / "episodes.parquet").empty


def test_names_cannot_break_out_of_the_page(
    tmp_path: Path, spec_dict: Callable[..., dict[str, Any]], write_run: Callable[..., Path]
) -> None:
    spec = {**spec_dict(), "title": "<script>alert(1)</script>"}
    spec["skill_labels"] = {"g0": "</script><b>"}
    page = build_report(write_run(tmp_path / "run", spec=spec)).read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert "</script><b>" not in page
