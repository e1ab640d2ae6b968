from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.episodes import episodes_from_segments
from analysis.figures import draw_figures
from analysis.figures.pairs import pair_rates
from analysis.run import Run, load_run
from analysis.schema import RunSpec
from analysis.tables.table import build_table


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path]) -> Run:
    return load_run(write_run(tmp_path_factory.mktemp("figures") / "run"))


def test_draws_what_there_is_data_for(run: Run, tmp_path: Path) -> None:
    """That the bytes are reproducible is tested on whole reports."""
    episodes = episodes_from_segments(run.segments, run.spec)
    table = build_table(episodes, run.spec, run.spec.tables[0])
    drawn = draw_figures(replace(run, training=[]), [table], tmp_path)
    assert [(figure.name, figure.table) for figure in drawn] == [
        ("table1-scores", "table1"),
        ("table1-distribution", "table1"),
        ("showcase", ""),
        ("pairs", ""),
    ]
    for figure in drawn:
        assert (tmp_path / f"{figure.name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<dc:date>" not in (tmp_path / f"{figure.name}.svg").read_text()


def test_pair_rates_are_of_the_second_skill_given_the_first(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    rates = pair_rates(segments, spec, "mb-stitch")
    assert rates.shape == (4, 4)
    assert np.isnan(np.diag(rates)).all()
    seconds = segments.query("method == 'mb-stitch' and prefix == 'g0>g2'")
    assert rates[0, 2] == pytest.approx(seconds["success"].mean())


def test_pair_rates_of_a_method_not_played_are_unknown(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    assert np.isnan(pair_rates(segments, spec, "unheard-of")).all()
