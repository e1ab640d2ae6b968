"""What runs and sweeps have around the sections of their pages."""

from pathlib import Path

from analysis.figures.drawn import Drawn
from analysis.page.frame import badges_html, figure_html, framed


def test_sections_without_content_are_left_out() -> None:
    page = framed("A", "maze", "", {"one": ("One", "<p>text</p>"), "two": ("Two", "")})
    assert '<section id="one"' in page
    assert '<a href="#one">One</a>' in page
    assert "Two" not in page


def test_titles_stay_text() -> None:
    page = framed("<i>A</i>", "m & n", badges_html(["a < b"], partial=True), {})
    assert "<h1>&lt;i&gt;A&lt;/i&gt;</h1>" in page
    assert "skillstitch · m &amp; n" in page
    assert '<span class="badge">a &lt; b</span><span class="badge partial">partial</span>' in page


def test_a_figure_is_inside_the_page(tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text("<svg/>")
    html = figure_html(Drawn("a", "what & why", ""), tmp_path)
    assert 'src="data:image/svg+xml;base64,' in html
    assert "<figcaption>what &amp; why</figcaption>" in html
    missing = figure_html(Drawn("a", "", "", missing="no <GL>"), tmp_path)
    assert missing == '<p class="note">no &lt;GL&gt;</p>'
