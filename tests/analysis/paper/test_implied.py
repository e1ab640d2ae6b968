"""What Table 8 implies: the stored bounds, against linear programs and by hand."""

import pytest

from analysis.paper.implied import (
    FIRST,
    MEAN,
    SECOND,
    averaged,
    bounds,
    can_share_first_skills,
    known_methods,
    skills,
    work_out,
)
from tests.rows import row

MEANS = {
    ("no-stitch", FIRST): (0.265, 0.323),
    ("random-stitch", FIRST): (0.130, 0.219),
    ("mf-stitch", FIRST): (0.273, 0.340),
    ("mb-stitch", FIRST): (0.300, 0.401),
    ("no-stitch", SECOND): (0.125, 0.183),
    ("mb-stitch", SECOND): (0.116, 0.219),
}


def stored(method: str, kind: str, skill: str) -> tuple[float, float]:
    found = row(bounds(method).set_index(["kind", "skill"]), kind, skill)
    return found["low"], found["high"]


@pytest.mark.parametrize(("method", "kind"), MEANS)
def test_means_of_first_and_second_skills(method: str, kind: str) -> None:
    """As worked out once by another program."""
    assert stored(method, kind, MEAN) == pytest.approx(MEANS[method, kind], abs=0.0006)


@pytest.mark.parametrize(
    ("method", "kind", "skill"),
    [
        ("no-stitch", FIRST, "bottom burner"),
        ("no-stitch", SECOND, "slide cabinet"),
        ("random-stitch", SECOND, MEAN),
        ("mf-stitch", FIRST, "kettle"),
        ("mb-stitch", FIRST, MEAN),
    ],
)
def test_the_file_holds_what_is_worked_out(method: str, kind: str, skill: str) -> None:
    assert stored(method, kind, skill) == pytest.approx(work_out(method, kind, skill), abs=1e-5)


def test_every_skill_of_every_method_is_bounded() -> None:
    for method in known_methods():
        table = bounds(method)
        rows = [(kind, skill) for kind in (FIRST, SECOND) for skill in (*skills(), MEAN)]
        assert list(zip(table["kind"], table["skill"], strict=True)) == rows
        assert (table["low"] <= table["high"]).all()
        assert (table["low"] >= 0).all()
        assert (table["high"] <= 1).all()


def test_what_a_second_skill_is_averaged_over() -> None:
    kettles = averaged(SECOND, "kettle")
    assert {first for first, _ in kettles} == set(skills()) - {"kettle"}
    assert averaged(FIRST, "kettle") == [("kettle",)]
    assert len(averaged(SECOND, MEAN)) == 42


def test_random_stitch_cannot_begin_like_no_stitch() -> None:
    """So the paper stitched before first skills, too; MF-Stitch, which has no pair, may not."""
    assert not can_share_first_skills("random-stitch", "no-stitch")
    assert can_share_first_skills("mf-stitch", "no-stitch")


def test_an_unknown_method_is_refused() -> None:
    with pytest.raises(KeyError, match="single-policy is not in the paper's Table 8"):
        bounds("single-policy")
