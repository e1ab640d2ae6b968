"""The report of a sweep as one self-contained HTML page, framed like that of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markdown_it import MarkdownIt

from analysis.page.figures import figure_html
from analysis.page.frame import badges_html, framed
from sweeps.results.sections import Section
from sweeps.search import search_spec
from sweeps.spec import SweepSpec


def render_page(sweep: SweepSpec, finished: int, sections: Sequence[Section], figures: Path) -> str:
    """The whole page; `figures` is the folder that the figures were drawn into.

    finished: trials that are. A sweep whose others are not is marked as partial.
    """
    spec = search_spec(sweep)
    badges = badges_html(
        [
            f"scale: {sweep.scale}",
            f"{finished} trials ({sweep.sampler})",
            f"{len(spec.tasks):,} tasks",
            f"{spec.seeds} seed{'s' if spec.seeds > 1 else ''}",
            f"{spec.episodes} episodes a task and seed",
        ],
        partial=finished < sweep.budget,
    )
    shown = {
        section.title.lower().replace(" ", "-"): (section.title, _html(section, figures))
        for section in sections
    }
    return framed(sweep.title, f"{spec.benchmark} · sweep", badges, shown)


def _html(section: Section, figures: Path) -> str:
    """Text of specs cannot become elements: HTML within the Markdown is escaped."""
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    text: str = markdown.render("\n".join(section.lines))
    text = text.replace("<table>", '<div class="scroll" tabindex="0"><table>')
    text = text.replace("</table>", "</table></div>")
    if section.on_page_only:
        text = f"<details><summary>Show</summary>{text}</details>"
    return text + "".join(figure_html(figure, figures) for figure in section.figures)
