"""What a table stands beside in the paper, and the files that have its numbers."""

from collections.abc import Container, Iterable
from html import escape

import pandas as pd

from analysis.paper.numbers import PAPER
from analysis.schema import TableEntry
from analysis.studies.distribution import distribution_table
from analysis.tables.table import Table

FILES = {
    "profile": {"profile": "first and second skills"},
    "rates": {"rates": "rates of every skill"},
    "pairs": {"pairs": "every pair", "pair-groups": "groups of pairs"},
    "forecast": {"forecast": "every pair"},
    "models": {"models": "every model"},
    "stitches": {"stitch-outcomes": "outcomes", "stitches": "every stitch"},
    "skills": {"single-skills": "every skill"},
    "every-task": {"permutations": "every permutation"},
}
"""Section of the page → its CSV files and what they hold."""
OF_ALL = ("permutations", "single-skills")  # not of a study

HEADING = "## Where it is from"

CSVS = {
    "scores": "scores",
    "gains": "paired gains",
    "seeds": "scores of each seed",
    "iqm": "interquartile means",
}
"""A table's CSV files → what they hold."""


def csv_tables(table: Table) -> dict[str, pd.DataFrame]:
    """By their names in CSVS; interquartile means only where a row has many tasks."""
    middle = distribution_table(table)
    more = {} if middle.empty else {"iqm": middle}
    return {"scores": table.scores, "gains": table.gains, "seeds": table.seed_scores} | more


def file_name(table: str, kind: str, *, kept: bool = False) -> str:
    """Of a table's CSV in a report, or as it is kept in a folder of the table's own."""
    if kept:
        return f"{kind}.csv"
    return f"{table}.csv" if kind == "scores" else f"{table}-{kind}.csv"


def paper_note(entry: TableEntry) -> str:
    """Which table of the paper this one stands beside."""
    if not entry.paper:
        return f"“{PAPER}” has no such table."
    return f"Beside Table {entry.paper} of “{PAPER}”."


def source_markdown(table: Table, *, kept: bool) -> str:
    """The paper's table, and links to the files beside the text."""
    links = ", ".join(
        f"[{CSVS[kind]}]({file_name(table.entry.id, kind, kept=kept)})"
        for kind in csv_tables(table)
    )
    return f"{HEADING}\n\n{paper_note(table.entry)} As CSV: {links}.\n"


def source_html(table: Table) -> str:
    """The same for the page of a report."""
    files = [(file_name(table.entry.id, kind), CSVS[kind]) for kind in csv_tables(table)]
    also = [(f"{table.entry.id}.{ending}", name) for ending, name in OTHER_FORMS.items()]
    return f'<p class="note">{escape(paper_note(table.entry))} {links_html([*files, *also])}</p>'


OTHER_FORMS = {"md": "Markdown", "tex": "LaTeX"}


def links_html(files: Iterable[tuple[str, str]]) -> str:
    """Links to files (name, what it holds) beside the page."""
    links = ", ".join(f'<a href="{escape(name)}">{escape(what)}</a>' for name, what in files)
    return f"Files beside this page: {links}."


def section_links(section: str, studies: Container[str]) -> str:
    """A paragraph for a section whose numbers are in files of their own; else nothing."""
    files = [
        (f"{file}.csv", what)
        for file, what in FILES.get(section, {}).items()
        if file in OF_ALL or file in studies
    ]
    return f'<p class="note">{links_html(files)}</p>' if files else ""
