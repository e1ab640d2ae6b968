"""The report of a Kitchen run; that of the maze is tested in test_report."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.figures.showcase.scenes import NoPictureError
from analysis.report import build_report, export_results
from tests.analysis.kitchen_run import write_kitchen

STUDIES = {
    "pairs.csv", "pair-groups.csv", "models.csv", "stitch-outcomes.csv", "stitches.csv",
    "profile.csv", "profile.md",
}  # fmt: skip
KITCHEN_FIGURES = {
    "stitch-values", "contact-sheet", "pairs", "diagnosis", "diagnosis-values", "stitch-outcomes",
}  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture(autouse=True)
def _drawing_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames themselves are tested in test_physics_figures."""

    def frames(scene: dict[str, Any], positions: np.ndarray) -> np.ndarray:
        grey = np.linspace(0, 255, 12 * 16 * 3).reshape(12, 16, 3)
        return np.repeat(grey[None], len(positions), axis=0).astype(np.uint8)

    monkeypatch.setattr("analysis.figures.showcase.showcases.render_frames", frames)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    for name in ("a", "b"):
        export_results(write_kitchen(write_run, tmp_path / name), tmp_path / f"results-{name}")
    assert contents(tmp_path / "a" / "report") == contents(tmp_path / "b" / "report")
    kept = contents(tmp_path / "results-a")
    assert kept == contents(tmp_path / "results-b")
    assert {f"table2/{study}" for study in STUDIES} <= set(kept)
    assert {f"table2/figures/{name}.png" for name in KITCHEN_FIGURES} <= set(kept)
    drawings = KITCHEN_FIGURES - {"contact-sheet"}  # it is a photograph
    vectors = {name for name in kept if name.endswith(".svg")}
    assert {f"table2/figures/{name}.svg" for name in drawings} <= vectors
    assert "table2/figures/contact-sheet.svg" not in vectors


def test_the_page_says_what_the_files_say(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    page = build_report(write_kitchen(write_run, tmp_path / "run")).read_text(encoding="utf-8")
    assert "Pairs of skills" in page
    assert "Are the models right?" in page
    assert "When does stitching hurt?" in page
    assert "pairs in the data (3)" in page.replace("\N{NO-BREAK SPACE}", " ")
    assert "97 of 100" in page
    assert "First and second skills" in page
    assert "No-Stitch and MB-Stitch share their first skills." in page
    assert "paper 0.697 to 1.000 · agrees" in page  # the microwave: 8 of 8
    assert "Framed: pairs that occur in the data" in page
    assert "MB-Stitch accomplishes more than No-Stitch in 8" in page
    groups = pd.read_csv(tmp_path / "run" / "report" / "pair-groups.csv")
    others = groups.query("group == 'other pairs' and method == 'mb-stitch'").iloc[0]
    assert (others["successes"], others["trials"], others["gain"]) == (36, 72, 0.5)


def test_without_a_picture_the_report_is_written_and_says_why(
    tmp_path: Path, write_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(scene: dict[str, Any], positions: np.ndarray) -> np.ndarray:
        raise NoPictureError("MuJoCo draws with nothing <here>; install libegl1 or libosmesa6")

    monkeypatch.setattr("analysis.figures.showcase.showcases.render_frames", nothing)
    run_dir = write_kitchen(write_run, tmp_path / "run")
    (folder,) = export_results(run_dir, tmp_path / "results")
    page = (run_dir / "report" / "index.html").read_text(encoding="utf-8")
    assert "no contact sheet: MuJoCo draws with nothing &lt;here&gt;; install libegl1" in page
    assert (folder / "figures" / "stitch-values.png").exists()
    assert not (folder / "figures" / "contact-sheet.png").exists()


def test_a_run_that_has_only_begun_can_be_reported(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run_dir = write_kitchen(write_run, tmp_path / "run", showcase=None)
    segments = pd.read_parquet(run_dir / "segments.parquet")
    segments.query("depth == 1").to_parquet(run_dir / "segments.parquet", index=False)
    page = build_report(run_dir).read_text(encoding="utf-8")
    assert "Pairs of skills" not in page
    assert "97 of 100" in page


def test_the_maze_is_reported_as_before(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    """Its datasets tell no orders."""
    plain = write_run(tmp_path / "plain")
    told = write_run(tmp_path / "told", datasets=[{"name": "demonstrations", "rows": 9}])
    for run_dir in (plain, told):
        build_report(run_dir)
    report = contents(plain / "report")
    assert report == contents(told / "report")
    assert not STUDIES & set(report)
    assert b"Are the models right?" not in report["index.html"]
    assert b"Framed" not in report["index.html"]
