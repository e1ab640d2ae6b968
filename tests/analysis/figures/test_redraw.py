"""Score figures drawn anew from what is kept, and the looks of those that are committed."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from analysis.figures.redraw import redraw_scores
from analysis.figures.scores import SEED
from analysis.figures.style import looks
from analysis.report import export_results
from analysis.schema import RunError

RESULTS = Path(__file__).parents[3] / "results"
DOT = f"fill-opacity: {SEED['alpha']}"
TABLES = sorted(file.parent.name for file in RESULTS.glob("*/scores.csv"))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path]) -> Path:
    root = tmp_path_factory.mktemp("redraw")
    run_dir = write_run(root / "run", training=None, showcase=None)
    (folder,) = export_results(run_dir, root / "results")
    return folder


def test_from_the_csv_files_it_is_the_same_figure(kept: Path) -> None:
    """Six decimals are more than a pixel can tell."""
    picture = kept / "figures" / "table1-scores.png"
    before = imread(picture)
    picture.unlink()
    assert redraw_scores(kept) == "table1-scores"
    np.testing.assert_allclose(imread(picture), before, atol=0.02)


def test_without_the_scores_of_each_seed_it_has_no_dots(kept: Path) -> None:
    drawing, seeds = kept / "figures" / "table1-scores.svg", kept / "seeds.csv"
    redraw_scores(kept)
    assert DOT in drawing.read_text()
    kept_seeds = seeds.read_text()
    seeds.unlink()
    redraw_scores(kept)
    seeds.write_text(kept_seeds)
    assert DOT not in drawing.read_text()


def test_a_folder_without_a_table_is_refused(tmp_path: Path, kept: Path) -> None:
    with pytest.raises(RunError, match=r"no scores\.csv in .*exported table"):
        redraw_scores(tmp_path)
    (tmp_path / "scores.csv").write_text((kept / "scores.csv").read_text())
    (tmp_path / "table.md").write_text("| Task | No-Stitch |\n")
    with pytest.raises(RunError, match="names other methods"):
        redraw_scores(tmp_path)
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("table", TABLES)
def test_a_method_looks_the_same_in_every_committed_figure(table: str) -> None:
    """A key of the legend is a line in its method's colour, in the order of the methods."""
    methods = list(dict.fromkeys(pd.read_csv(RESULTS / table / "scores.csv")["method"]))
    drawing = (RESULTS / table / "figures" / f"{table}-scores.svg").read_text()
    legend = drawing[drawing.index('id="legend_1"') :]
    keys = re.findall(r"stroke: (#[0-9a-f]{6}); stroke-width: 1.5", legend)
    assert keys[: len(methods)] == [looks(methods)[method][0].lower() for method in methods]
