"""What every page has around its sections: title, style and navigation, all inside one file."""

from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path
from string import Template

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


def asset(name: str) -> str:
    """The text of a file beside this module."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")
