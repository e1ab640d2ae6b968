"""What every page has around its sections: title, style and navigation, all inside one file."""

import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from string import Template

from analysis.figures.drawn import Drawn

Sections = Mapping[str, tuple[str, str]]
"""Id → title and HTML, in their order."""


def framed(title: str, subject: str, badges: str, sections: Sections, scripts: str = "") -> str:
    """A whole page of sections; those without content are left out.

    badges: of `badges_html`. scripts: script elements that end the page.
    """
    shown = {name: section for name, section in sections.items() if section[1]}
    return Template(asset("report.html")).substitute(
        title=escape(title),
        subject=escape(subject),
        badges=badges,
        navigation="".join(
            f'<a href="#{escape(name)}">{escape(heading)}</a>'
            for name, (heading, _) in shown.items()
        ),
        body="\n".join(
            f'<section id="{escape(name)}" aria-labelledby="{escape(name)}-title">'
            f'<h2 id="{escape(name)}-title">{escape(heading)}</h2>{content}</section>'
            for name, (heading, content) in shown.items()
        ),
        style=asset("report.css"),
        scripts=scripts,
    )


def badges_html(texts: Iterable[str], *, partial: bool = False) -> str:
    """Short facts below the title; `partial` adds that something is missing."""
    html = "".join(f'<span class="badge">{escape(text)}</span>' for text in texts)
    return html + ('<span class="badge partial">partial</span>' if partial else "")


def figure_html(figure: Drawn, folder: Path) -> str:
    """A figure with its caption; `folder` is where it was drawn."""
    if figure.missing:
        return f'<p class="note">{escape(figure.missing)}</p>'
    # As an image of its own, an SVG's element ids cannot clash with another's.
    file = folder / figure.files[0]
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    kind = "svg+xml" if file.suffix == ".svg" else "png"
    caption = escape(figure.caption)
    return (
        f'<figure><img src="data:image/{kind};base64,{data}" alt="{caption}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def asset(name: str) -> str:
    """The text of a file beside this module."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
