"""What a table stands beside, and its files: every link leads to a file that is there."""

import re
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from analysis.page.sources import paper_note
from analysis.report import build_report, export_results
from analysis.schema import TableEntry
from tests.analysis.kitchen_run import write_kitchen

LINK = re.compile(r"\[[^]]+\]\(([^)]+)\)|<a href=\"([^#\"]+)\"")


def links(text: str) -> set[str]:
    return {markdown or html for markdown, html in LINK.findall(text)}


@pytest.fixture(scope="module")
def folders(
    tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path]
) -> tuple[Path, Path]:
    """A report, and what is kept of it."""
    root = tmp_path_factory.mktemp("sources")
    run_dir = write_run(root / "run", training=None, showcase=None)
    export_results(run_dir, root / "results")
    return run_dir / "report", root / "results" / "table1"


def test_the_paper_and_its_table_are_named(folders: tuple[Path, Path]) -> None:
    report, kept = folders
    for file in (report / "table1.md", report / "index.html", kept / "table.md"):
        assert "Beside Table 1 of “Offline Model-Based Skill Stitching”." in file.read_text()


def test_a_table_that_the_paper_lacks() -> None:
    assert "has no such table" in paper_note(TableEntry("levels", "", "variant", "Levels"))


def test_links_lead_to_files(folders: tuple[Path, Path]) -> None:
    report, kept = folders
    csvs = {"table1.csv", "table1-gains.csv", "table1-seeds.csv", "table1-iqm.csv"}
    assert links((report / "table1.md").read_text()) == csvs
    assert csvs < links((report / "index.html").read_text())
    assert links((kept / "table.md").read_text()) == {
        "scores.csv", "gains.csv", "seeds.csv", "iqm.csv",
    }  # fmt: skip
    for file in (report / "table1.md", report / "index.html", kept / "table.md"):
        for name in links(file.read_text()):
            assert (file.parent / name).is_file(), f"{file.name}: {name}"


def test_sections_of_the_page_link_to_theirs(
    tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    page = build_report(write_kitchen(write_run, tmp_path / "run", showcase=None))
    found = links(page.read_text())
    assert {"pairs.csv", "pair-groups.csv", "permutations.csv", "single-skills.csv"} <= found
    assert all((page.parent / name).is_file() for name in found)


def test_seeds_average_to_the_scores(folders: tuple[Path, Path]) -> None:
    _, kept = folders
    scores = pd.read_csv(kept / "scores.csv").set_index(["row", "method"])["score"]
    seeds = pd.read_csv(kept / "seeds.csv")
    assert set(seeds["seed"]) == {0, 1, 2}
    means = seeds.groupby(["row", "method"])["score"].mean()
    pd.testing.assert_series_equal(means[scores.index], scores, atol=2e-6)
