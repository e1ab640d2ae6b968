"""What came of stitches, and what warned: in numbers, on the page, and as a figure."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.figures.stitches import draw_outcomes
from analysis.figures.style import house_style
from analysis.page.studies import stitches_section
from analysis.run import Run, load_run
from analysis.studies.stitches import (
    FIRST_SKILLS,
    HAND_OVERS,
    gains,
    outcome,
    outcome_table,
    stitch_table,
)
from tests.analysis.kitchen_run import kitchen_first_skills, kitchen_stitches, write_kitchen
from tests.rows import row


@pytest.fixture(params=["alone", "merged"])
def run(request: pytest.FixtureRequest, tmp_path: Path, write_run: Callable[..., Path]) -> Run:
    """A run of its own, or two merged, of which one has no stitches."""
    study = kitchen_stitches()
    if request.param == "merged":
        study = {"parts": {"level-1": study, "level-2": study | {"stitches": []}}}
    return load_run(write_kitchen(write_run, tmp_path / "run", stitches=study))


def section(run: Run) -> str:
    studies = {"stitch-outcomes": outcome_table(run), "stitches": stitch_table(run)}
    return stitches_section(run, studies)


def test_outcomes_are_paired() -> None:
    outcomes = [outcome(stitch) for stitch in kitchen_stitches()["stitches"]]
    assert outcomes == ["helped", "helped", "hurt", "succeeded either way"]


def test_gains_are_of_each_plan_s_first_action() -> None:
    (_, _, hurt, nothing) = kitchen_stitches()["stitches"]
    np.testing.assert_allclose(gains(hurt), [[1, -1], [1, -1]])
    assert gains(nothing).shape == (0, 2)
    skipped = hurt | {"plans": hurt["plans"][1:]}  # a plan of which more was carried out
    np.testing.assert_allclose(gains(skipped), [[1, -1]])


def test_a_part_in_numbers(run: Run) -> None:
    table = outcome_table(run)
    assert table["part"].tolist() == list(run.stitches)
    row = table.iloc[0]
    assert (row["episodes"], row["stitches"], row["plans"]) == (4, 3, 6)
    assert (row["successes_without"], row["successes_with"]) == (2, 3)
    assert (row["helped"], row["hurt"], row["succeeded_either_way"]) == (2, 1, 0)
    assert row["predicted_gain"] == pytest.approx(1)
    assert row["realised_gain"] == pytest.approx((0.5 + 1 - 1) / 3)
    assert row["auc_value_spread"] == row["auc_distance_end"] == 1  # warned
    assert row["auc_dynamics_spread"] == 0.5  # told nothing
    assert np.isnan(row["rank_correlation"])  # all were predicted to gain the same


def test_stitches_of_no_step_are_none(run: Run) -> None:
    stitches = stitch_table(run)
    assert stitches["episode"].tolist() == [0, 1, 2]
    hurt = stitches.set_index("outcome").loc["hurt"]
    assert (hurt["value_start"], hurt["value_end"]) == (-9, -11)
    assert hurt["distance_end"] == pytest.approx(0.6)


def test_the_page_has_a_line_for_each_part_and_outcome(run: Run) -> None:
    html = section(run)
    assert "2 of 4" in html
    assert "1 pair, 5 episodes of each" in html
    for part in run.stitches:
        name = f"{part}: {HAND_OVERS}" if part else HAND_OVERS
        assert f'<th scope="row">{name}</th>' in html
    assert "from the start" not in html
    assert "failed either way</th>" not in html
    assert "-9.00 → -11.00" in html


def test_first_skills_and_hand_overs_are_told_apart(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    study = kitchen_first_skills()
    run = load_run(write_kitchen(write_run, tmp_path / "run", stitches=study))
    table = outcome_table(run).set_index("kind")
    assert table["stitches"].to_dict() == {FIRST_SKILLS: 2, HAND_OVERS: 3}
    assert table["hurt"].to_dict() == {FIRST_SKILLS: 2, HAND_OVERS: 1}
    assert np.isnan(row(table, FIRST_SKILLS)["auc_value_spread"])  # all of them hurt
    assert table.loc[HAND_OVERS, "auc_value_spread"] == 1
    html = section(run)
    assert "1 first skill and 1 pair, 5 episodes of each" in html
    assert "Every first skill from the start of an episode, and every ordered pair" in html
    for kind in (FIRST_SKILLS, HAND_OVERS):
        assert f'<th scope="row">{kind}</th>' in html
    with house_style():
        figure = draw_outcomes(run.stitches)
    assert len(figure.axes) == 2 * 4
    assert FIRST_SKILLS in figure.axes[0].get_ylabel()


def test_nothing_was_stitched(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    nothing = kitchen_stitches() | {"stitches": []}
    run = load_run(write_kitchen(write_run, tmp_path / "run", stitches=nothing))
    assert outcome_table(run)["stitches"].tolist() == [0]
    assert section(run) == ""
    without = load_run(write_kitchen(write_run, tmp_path / "without", stitches=None))
    assert without.stitches == {}
    assert stitches_section(without, {}) == ""


def test_a_part_with_stitches_is_a_row_of_four_panels(run: Run) -> None:
    with house_style():
        figure = draw_outcomes(run.stitches)
    assert len(figure.axes) == 4
    value, distance, gain, _ = figure.axes
    assert len(value.lines) == 2 * 3
    assert ("level-1" in value.get_ylabel()) == ("level-1" in run.stitches)
    assert distance.get_xlim() == distance.get_ylim()
    assert gain.get_xlim() == gain.get_ylim()
