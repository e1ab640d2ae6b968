"""The report of a sweep: one page that needs nothing else, and the same as Markdown."""

import json
import re
import shutil
from dataclasses import replace
from html import unescape
from pathlib import Path
from unittest import mock

import pytest

from orchestrator.storage.rundir import RunDirectory
from sweeps.results.again import SOURCE
from sweeps.results.report import summary
from sweeps.spec import Confirm
from sweeps.sweep import report_again
from tests.sweeps.tiny import TINY_SWEEP, sweep_in, tiny_sweep


@pytest.fixture(scope="module")
def sweep(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """The finished sweep with a report that has figures; its title is not to be trusted."""
    folder = tmp_path_factory.mktemp("reported") / "sweep"
    shutil.copytree(finished / "sweep", folder)
    directory = RunDirectory(folder)
    asked = directory.asked_sweep()
    assert asked
    directory.write_json("sweep.json", asked | {"title": "A <b>tiny</b> search"})
    directory.write_json(SOURCE, str(TINY_SWEEP))
    report_again(directory, folder.parent / "results")
    return directory


@pytest.fixture(scope="module")
def page(sweep: RunDirectory) -> str:
    return (sweep.path / "report" / "index.html").read_text(encoding="utf-8")


def section(page: str, name: str) -> str:
    found = re.search(rf'<section id="{name}".*?</section>', page, re.DOTALL)
    assert found, name
    return found.group()


def test_the_page_is_one_file(sweep: RunDirectory, page: str) -> None:
    """It fetches nothing; what it links to lies beside it."""
    sources = re.findall(r'src="([^"]{0,30})', page)
    assert len(sources) == 4
    assert all(source.startswith("data:image/svg+xml;base64,") for source in sources)
    links = [link for link in re.findall(r'href="([^"]*)"', page) if link[0] != "#"]
    assert links == ["data:,", "confirm.csv", "trials.csv", "trials.json"]
    for link in links[1:]:
        assert (sweep.path / "report" / link).stat().st_size
    assert "http" not in page


def test_it_has_what_was_searched_and_found(sweep: RunDirectory, page: str) -> None:
    winner = sweep.read_json("winner.json")
    assert f"Trial {winner['trial']}: alpha " in section(page, "winner")
    assert f"{winner['confirmed']['gain']:+.3f} [" in section(page, "winner")
    assert section(page, "best-trials-in-the-search").count("<tr>") == 1 + 10
    for name in ("history", "importances", "slices", "α-×-β"):
        assert section(page, name).count("<img") == 1
    assert section(page, "all-trials").count("<tr>") == 1 + 10
    space = section(page, "search-space")
    assert "<td>0.1 to 50</td>\n<td>logarithmic</td>\n<td>10</td>" in space
    assert "<td>2 to 16</td>\n<td>whole numbers, linear</td>\n<td>16</td>" in space
    how = section(page, "how-it-was-searched")
    assert "<td>base, rollout.temperature</td>\n<td>1.0</td>" in how
    assert "<td>held-out tasks</td>\n<td>g2 → g3, g3 → g1</td>" in how
    again = unescape(section(page, "made-again-by"))
    assert "skillstitch sweep tiny-sweep.toml --scale paper --trials 10\n" in again
    assert "artifacts trained" in section(page, "what-it-took")
    assert "<td>git_revision</td>" in section(page, "provenance")


def test_text_of_a_spec_stays_text(page: str) -> None:
    assert "<title>A &lt;b&gt;tiny&lt;/b&gt; search</title>" in page
    assert "<b>" not in page


def test_the_markdown_says_the_same_without_what_is_of_this_day(sweep: RunDirectory) -> None:
    text = (sweep.path / "report" / "index.md").read_text(encoding="utf-8")
    assert "## Search space" in text
    assert "![Every trial, with its 95 % interval" in text
    assert "git_revision" not in text
    assert "## All trials" not in text
    assert "## What it took" not in text
    assert str(TINY_SWEEP.parent) not in text


def test_a_terminal_gets_what_comes_before_the_figures(sweep: RunDirectory) -> None:
    text = summary((sweep.path / "report" / "index.md").read_text(encoding="utf-8"))
    assert text.startswith("# A <b>tiny</b> search")
    assert "## Best trials in the search" in text
    assert "## History" not in text


def test_an_export_has_the_report_without_the_page(sweep: RunDirectory) -> None:
    """A page has the day and the machine in it; what is kept with the code should not."""
    (folder,) = (sweep.path.parent / "results").iterdir()
    assert {path.name for path in folder.iterdir()} == {
        "index.md", "trials.csv", "trials.json", "confirm.csv", "figures", "provenance.json",
    }  # fmt: skip


def test_a_report_written_again_has_fields_in_the_order_asked(trained: Path) -> None:
    """A sweep's own file has them sorted."""
    asked = tiny_sweep()
    space = dict(sorted(asked.space.items(), reverse=True))
    directory = sweep_in(trained, replace(asked, space=space, trials=2, confirm=Confirm(best=0)))
    written = {path.name: path.read_bytes() for path in (directory.path / "report").glob("*.*")}
    with mock.patch("sweeps.results.report.draw_figures", return_value=[]):
        report_again(directory, None)
    for name, content in written.items():
        assert (directory.path / "report" / name).read_bytes() == content, name


def test_a_sweep_that_goes_on_says_so(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished / "sweep", tmp_path / "sweep")
    directory = RunDirectory(tmp_path / "sweep")
    asked = directory.asked_sweep()
    assert asked
    directory.write_json("sweep.json", asked | {"trials": 12})
    for name in ("confirm.json", "provenance.json", "counts.json"):
        (directory.path / name).unlink()
    report_again(directory, None)
    page = (directory.path / "report" / "index.html").read_text(encoding="utf-8")
    assert '<span class="badge partial">partial</span>' in page
    assert "10 trials of 12, the others are not finished" in page
    assert 'id="provenance"' not in page
    assert json.loads((directory.path / "report" / "trials.json").read_text())
