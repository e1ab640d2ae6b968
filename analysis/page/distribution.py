"""Interquartile means beside a table, as Markdown and on the page."""

from html import escape

from analysis.page.tables import html_table
from analysis.studies.distribution import (
    distribution_header,
    distribution_lines,
    distribution_note,
    distribution_table,
)
from analysis.tables.table import Table
from analysis.tables.writers import markdown_table

TITLE = "Interquartile means"


def distribution_markdown(table: Table) -> str:
    """Nothing where no row has many tasks."""
    found = distribution_table(table)
    if found.empty:
        return ""
    lines = markdown_table(distribution_header(table), distribution_lines(table, found))
    return f"## {TITLE}\n\n{lines}\n\n{distribution_note(found)}\n"


def distribution_html(table: Table) -> str:
    """The same as a part of the table's section."""
    found = distribution_table(table)
    if found.empty:
        return ""
    lines = html_table(distribution_header(table), distribution_lines(table, found))
    note = f'<p class="note">{escape(distribution_note(found))}</p>'
    return f"<h3>{TITLE}</h3>{lines}{note}"
