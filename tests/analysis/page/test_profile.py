"""First and second skills as text, beside the paper's."""

from dataclasses import replace

import pandas as pd

from analysis.page.profile import profile_markdown, profile_section
from analysis.paper.profile import profile
from tests.analysis.paper.test_profile import KETTLE, MICROWAVE, SPEC, play

COLUMNS = ["seed", "method", "prefix", "depth", "episode", "success", "end_step"]


def lines(markdown: str, heading: str) -> dict[str, str]:
    """The rows of one of the two tables, by their first cell."""
    rows = markdown[markdown.index(f"| {heading}") :].split("\n\n")[0].splitlines()[2:]
    return {row.split(" | ")[0].removeprefix("| "): row for row in rows}


def test_every_rate_stands_beside_the_paper_s() -> None:
    segments = pd.DataFrame(play("no-stitch", ""), columns=COLUMNS)
    spec = replace(SPEC, methods={"no-stitch": "No-Stitch"})
    table = profile(segments, spec, "no-stitch")
    text = profile_markdown(table, spec)
    first = lines(text, "First skill succeeds")
    assert "0.750 (6 of 8)" in first[MICROWAVE]
    assert "paper 0.697 to 1.000 · agrees" in first[MICROWAVE]
    assert "paper 0.543 to 1.000 · lower" in first["bottom burner"]
    assert "paper 0.265 to 0.323 · lower" in first["mean of all first skills"]
    second = lines(text, "First two skills succeed, by the second")
    assert "0.083 (4 of 48)" in second[KETTLE]
    assert len(second) == len(spec.skills) + 1
    assert "share their first skills" not in text  # there is but one method
    page = profile_section(table, spec)
    assert "paper 0.697 to 1.000 · agrees" in page
    assert page.count("<table") == 2


def test_other_runs_have_no_such_section() -> None:
    assert profile_section(None, SPEC) == ""
