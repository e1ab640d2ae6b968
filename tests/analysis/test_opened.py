"""A run as pandas tables: the same numbers as its report."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from analysis import open_run
from analysis.report import build_report
from analysis.schema import RunError


@pytest.fixture
def run_dir(write_run: Callable[..., Path], tmp_path: Path) -> Path:
    return write_run(tmp_path / "run")


def test_scores_and_gains_are_the_report_s(run_dir: Path) -> None:
    run = open_run(str(run_dir))
    build_report(run_dir)
    (table, *_) = run.tables
    for name, frame in ((table, run.scores()), (f"{table}-gains", run.gains(table))):
        printed = pd.read_csv(run_dir / "report" / f"{name}.csv")
        pd.testing.assert_frame_equal(frame, printed, check_dtype=False, atol=1e-6)


def test_episodes_are_the_written_ones(run_dir: Path) -> None:
    run = open_run(run_dir)
    build_report(run_dir)
    written = pd.read_parquet(run_dir / "episodes.parquet")
    pd.testing.assert_frame_equal(run.episodes, written, check_dtype=False)
    assert len(run.segments) >= len(run.episodes) / 10


def test_what_is_not_there_is_named(run_dir: Path, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no table 'table9'; there are "):
        open_run(run_dir).scores("table9")
    with pytest.raises(RunError, match=r"no spec\.json in"):
        open_run(tmp_path)
