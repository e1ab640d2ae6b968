"""What runs and sweeps have around the sections of their pages."""

from analysis.page.frame import badges_html, framed


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
