from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from analysis.episodes import episodes_from_segments
from analysis.figures import draw_figures
from analysis.figures.curves import draw_curves
from analysis.figures.diagnosis import draw_predictions
from analysis.figures.distribution import draw_distributions
from analysis.figures.pairs import NO_EPISODE, draw_pairs, pair_rates
from analysis.figures.scores import SEED, draw_scores
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


def test_every_seed_has_a_dot_where_there_are_several(run: Run) -> None:
    episodes = episodes_from_segments(run.segments, run.spec)
    table = build_table(episodes, run.spec, run.spec.tables[0])
    figure = draw_scores(table.scores, table.labels, table.seed_scores)
    dots = [line for line in figure.axes[0].lines if line.get_markersize() == SEED["ms"]]
    drawn = sorted(float(line.get_xdata()[0]) for line in dots)  # type: ignore[index, arg-type]
    assert drawn == pytest.approx(sorted(table.seed_scores["score"]))
    assert len(drawn) == 3 * 3 * 4  # seeds, rows, methods
    assert "seeds" in legend_of(figure)
    alone = table.seed_scores.query("seed == 0")
    assert "seeds" not in legend_of(draw_scores(table.scores, table.labels, alone))
    assert "seeds" not in legend_of(draw_scores(table.scores, table.labels))


def test_dots_are_promised_where_several_seeds_were_played(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not where several were asked for."""
    monkeypatch.setattr("analysis.figures.save", lambda *_: None)
    bare = replace(run, training=[], segments=run.segments.query("seed == 0"))
    for segments, promised in ((run.segments, True), (bare.segments, False)):
        episodes = episodes_from_segments(segments, run.spec)
        table = build_table(episodes, run.spec, run.spec.tables[0])
        scores, profile, *_ = draw_figures(bare, [table], tmp_path)
        assert ("Small dots" in scores.caption) == promised
        assert "the share of runs, a task under one seed's models each" in profile.caption


def legend_of(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_profiles_have_a_panel_for_each_row_of_many_tasks(run: Run) -> None:
    episodes = episodes_from_segments(run.segments, run.spec)
    table = build_table(episodes, run.spec, run.spec.tables[0])
    figure = draw_distributions(table)
    assert [axes.get_title() for axes in figure.axes] == ["2 goals", "3 goals", "4 goals"]
    assert [len(axes.lines) for axes in figure.axes] == [4, 4, 4]
    assert figure.get_supylabel() == "share of runs with a score above τ"
    assert legend_of(figure) == list(table.labels.values())


def test_a_curve_of_one_point_is_seen() -> None:
    points = {"loss": [[400, 0.5]], "value": [[200, 0.1], [400, 0.2]]}
    figure = draw_curves([{"kind": "agent", "seed": 0, "curves": points}])
    (alone,), (curve,) = (axes.lines for axes in figure.axes)
    assert alone.get_marker() == "o"
    assert curve.get_marker() == "None"


def test_the_legend_of_predictions_lies_off_the_data() -> None:
    study = {
        "groups": {"arm": {"relative": 0.2}, "objects": {"relative": 0.9}},
        "points": [[0.1, 0.2], [0.3, 0.4]],
        "disagreement_rank_correlation": 0.5,
    }
    figure = draw_predictions({"1": study, "5": study})
    assert all(axes.get_legend() is None for axes in figure.axes)
    assert legend_of(figure) == ["1 step", "5 steps"]


def test_frames_and_blank_cells_of_pairs_are_explained(
    segments: pd.DataFrame, spec: RunSpec
) -> None:
    methods = ("no-stitch", "mb-stitch")
    figure = draw_pairs(segments, spec, methods, [("g0", "g1")])
    assert legend_of(figure) == ["in the data, one right after the other", NO_EPISODE]
    assert figure.axes[0].patch.get_hatch()
    assert legend_of(draw_pairs(segments, spec, methods)) == [NO_EPISODE]


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
