"""Opens the report in a real headless Chromium, as a reader would."""

import base64
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from analysis.report import build_report

pytestmark = pytest.mark.browser

CHROMIUM_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    executable = shutil.which("chromium")
    if executable is None:
        message = "chromium is not installed: apt-get install chromium"
        if os.environ.get("SKILLSTITCH_REQUIRE_BROWSER") == "1":
            pytest.fail(message)
        pytest.skip(message)
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=executable, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, write_run: Callable[..., Path]) -> Path:
    return build_report(write_run(tmp_path_factory.mktemp("browser") / "run"))


@pytest.fixture
def page(chromium: Any, report: Path) -> Iterator[Any]:
    """The opened report; at the end, nothing may have gone wrong and nothing been fetched."""
    page = chromium.new_page(viewport={"width": 1200, "height": 900})
    complaints: list[str] = []
    requests: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    page.goto(report.as_uri())
    yield page
    page.close()
    assert complaints == []
    assert [url for url in requests if not url.startswith("data:")] == [report.as_uri()]


def column(page: Any, number: int) -> list[str]:
    return page.locator(f"#permutations tbody td:nth-child({number})").all_inner_texts()


def test_shows_the_table_beside_the_paper(page: Any) -> None:
    cell = page.locator("#table1 table.scores tbody tr").first.locator("td").last
    assert "paper 0.986 ± 0.000" in cell.inner_text()
    assert "agrees" in cell.inner_text()
    assert page.get_by_text("scale: quick", exact=True).is_visible()
    assert page.get_by_text("3 seeds", exact=True).is_visible()


def test_every_figure_is_drawn(page: Any) -> None:
    figures = page.locator("figure img")
    assert figures.count() == 5
    for i in range(figures.count()):
        figures.nth(i).scroll_into_view_if_needed()
        assert figures.nth(i).is_visible()
        assert figures.nth(i).evaluate("image => image.complete && image.naturalWidth") > 100
        assert figures.nth(i).get_attribute("alt")


def test_permutations_can_be_sorted(page: Any) -> None:
    page.get_by_role("button", name="Score").click()
    scores = [float(text) for text in column(page, 4)]
    assert scores == sorted(scores, reverse=True)
    head = page.locator("#permutations th", has_text="Score")
    assert head.get_attribute("aria-sort") == "descending"
    page.get_by_role("button", name="Score").click()
    scores = [float(text) for text in column(page, 4)]
    assert scores == sorted(scores)
    page.get_by_role("button", name="Task", exact=True).click()
    assert column(page, 1) == sorted(column(page, 1))
    assert head.get_attribute("aria-sort") is None


def test_permutations_can_be_filtered(page: Any) -> None:
    page.get_by_label("Tasks with").fill("g0 → g1")
    page.get_by_label("Method").select_option("MB-Stitch")
    tasks = column(page, 1)
    assert tasks
    assert all("g0" in task and "g1" in task for task in tasks)
    assert set(column(page, 3)) == {"MB-Stitch"}
    page.get_by_label("Tasks with").fill("no such skill")
    assert column(page, 1) == []
    assert page.locator("#permutation-count").inner_text() == "0 of 0 rows shown"


def test_more_permutations_are_shown_on_demand(page: Any) -> None:
    assert len(column(page, 1)) == 40
    page.get_by_role("button", name="Show more").click()
    assert len(column(page, 1)) == 240
    assert page.get_by_role("button", name="Show more").is_hidden()


@pytest.mark.parametrize("width", [390, 1200])
def test_letters_in_figures_can_be_read(page: Any, width: int) -> None:
    """At least nine pixels high, however wide the screen; what is wider than it scrolls."""
    page.set_viewport_size({"width": width, "height": 800})
    figures = page.locator("figure img")
    for i in range(figures.count()):
        svg = base64.b64decode(figures.nth(i).get_attribute("src").partition(",")[2]).decode()
        letters = min(float(scale) for scale in re.findall(r"scale\((0\.\d+) -0\.\d+\)", svg)) * 100
        drawn = float(re.findall(r'width="([\d.]+)pt"', svg)[0])
        shown = figures.nth(i).evaluate(
            "image => image.clientWidth - 2 * parseFloat(getComputedStyle(image).paddingLeft)"
        )
        assert letters * shown / drawn >= 8.99, f"figure {i}: {letters} of {drawn} points"
        box = figures.nth(i).locator("..")
        assert box.evaluate("box => box.clientWidth") < width


def test_nothing_sticks_out_on_a_narrow_screen(page: Any) -> None:
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
