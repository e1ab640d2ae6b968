"""The forecast of pairs beside what was played."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.report import build_report
from analysis.run import load_run
from analysis.studies.forecast import COLUMNS, agreement, agreement_text, forecast_table
from tests.analysis.kitchen_run import kitchen_files, write_kitchen
from tests.rows import row


def table(forecasts: list[float], successes: list[int], trials: int = 10) -> pd.DataFrame:
    rows = [
        [f"a{n}", "b", 0.0, forecast, wins, trials, wins / trials if trials else np.nan]
        for n, (forecast, wins) in enumerate(zip(forecasts, successes, strict=True))
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def test_counts_are_no_stitchs_over_all_seeds(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    found = forecast_table(load_run(write_kitchen(write_run, tmp_path / "run")))
    rows = found.set_index(["first", "second"])
    assert row(rows, "microwave", "kettle")[["successes", "trials"]].tolist() == [4, 8]
    assert rows.loc[("kettle", "microwave"), "rate"] == 0


def test_the_brier_score_is_of_single_trials() -> None:
    found = agreement(table([0.9, 0.5, 0.2], [10, 5, 0]))
    assert found is not None
    outcomes = np.repeat([1.0, 1.0, 0.0, 0.0], [10, 5, 5, 10])
    foretold = np.repeat([0.9, 0.5, 0.2], 10)
    assert found.brier == pytest.approx(np.mean((foretold - outcomes) ** 2))
    assert found.brier_of_mean == pytest.approx(0.25)
    assert found.brier_of_rates == pytest.approx(0.25 / 3)
    assert found.rank_correlation == pytest.approx(1)
    assert "3 pairs" in agreement_text(found)


def test_nothing_is_said_of_too_little() -> None:
    assert agreement(table([0.1, 0.2], [1, 2])) is None
    assert agreement(table([0.1, 0.2, 0.3], [5, 5, 5])) is None
    assert agreement(table([0.1, 0.2, 0.3], [0, 0, 0], trials=0)) is None


def test_the_report_has_a_section_a_figure_and_a_table(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    page = build_report(write_kitchen(write_run, tmp_path / "run"))
    assert "A forecast of pairs" in page.read_text()
    assert len(pd.read_csv(page.parent / "forecast.csv")) == 12
    assert (page.parent / "figures" / "forecast.svg").is_file()


def test_a_run_without_a_forecast_has_none(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    files = kitchen_files()
    del files["diagnosis"]["forecast"]
    page = build_report(write_kitchen(write_run, tmp_path / "run", **files))
    assert "A forecast of pairs" not in page.read_text()
    assert not (page.parent / "forecast.csv").exists()
