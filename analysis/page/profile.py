"""First and second skills beside the paper's, as Markdown and as a section of the page."""

import math
from collections.abc import Callable
from html import escape

import pandas as pd

from analysis.page.tables import table_of
from analysis.paper.implied import FIRST, MEAN, SECOND
from analysis.paper.profile import MARGIN
from analysis.paper.verdicts import AGREES, HIGHER, LOWER
from analysis.schema import RunSpec
from analysis.tables.writers import Record, markdown_table

TITLE = "First and second skills"
HEADINGS = {FIRST: "First skill succeeds", SECOND: "First two skills succeed, by the second"}
MEANS = {FIRST: "mean of all first skills", SECOND: "mean of all pairs"}

NOTE = (
    "How often a task's first skill succeeds, and how often its first two both do, averaged over "
    "what comes first (not only where the first has succeeded). In brackets 95 % intervals: of a "
    "first skill Wilson's, which takes episodes as independent and covers the models trained here; "
    "else from resampling seeds and each first skill's episodes. The paper prints no such "
    "rates, but its Table 8 confines them: the range beside each is all that linear programming "
    f"finds possible under its cells. A rate “{AGREES}” within {MARGIN} of that range; “{HIGHER}” "
    f"or “{LOWER}” says where it is otherwise."
)


def shared_note(spec: RunSpec) -> str:
    """Whose first skills are the same episodes."""
    shared = spec.sharing_first_skills
    return f"{' and '.join(shared)} share their first skills." if len(shared) > 1 else ""


def profile_markdown(profile: pd.DataFrame, spec: RunSpec) -> str:
    """First and second skills beside what Table 8 implies for them, as Markdown."""
    notes = [f"{note}\n" for note in (NOTE, shared_note(spec)) if note]
    lines = [f"# {TITLE}", "", *notes]
    for kind, heading in HEADINGS.items():
        header, rows = _matrix(profile, spec, kind, heading, lambda row: "<br>".join(_texts(row)))
        lines += [markdown_table(header, rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def profile_section(profile: pd.DataFrame | None, spec: RunSpec) -> str:
    """Nothing where the run is not of the paper's Table 2 or 8."""
    if profile is None:
        return ""
    notes = [note for note in (NOTE, shared_note(spec)) if note]
    html = "".join(f'<p class="note">{escape(note)}</p>' for note in notes)
    for kind, heading in HEADINGS.items():
        header, rows = _matrix(profile, spec, kind, heading, _cell_html)
        html += table_of(header, rows, ' class="scores"')
    return html


def _matrix(
    profile: pd.DataFrame, spec: RunSpec, kind: str, heading: str, text: Callable[[Record], str]
) -> tuple[list[str], list[list[str]]]:
    """A row a skill and one for the mean, a column a method."""
    records = profile[profile["kind"] == kind].to_dict("records")
    cells = {(row["skill"], row["method"]): text(row) for row in records}
    rows = [
        [
            MEANS[kind] if skill == MEAN else spec.skill_label(skill),
            *(cells.get((skill, method), "–") for method in spec.methods),
        ]
        for skill in dict.fromkeys(row["skill"] for row in records)
    ]
    return [heading, *spec.methods.values()], rows


def _texts(row: Record) -> list[str]:
    """Ours; its interval; what the paper implies, and how ours stands to it."""
    texts = [
        f"{row['rate']:.3f} ({row['successes']:,} of {row['n']:,})",
        f"[{row['ci_low']:.3f}, {row['ci_high']:.3f}]",
    ]
    if not math.isnan(row["implied_low"]):
        implied = f"paper {row['implied_low']:.3f} to {row['implied_high']:.3f}"
        texts.append(f"{implied} · {_verdict(row)}")
    return texts


def _cell_html(row: Record) -> str:
    ours, *asides = map(escape, _texts(row))
    html = f'<span class="score">{ours}</span>'
    return html + "".join(f'<span class="aside">{aside}</span>' for aside in asides)


def _verdict(row: Record) -> str:
    if row["inside"]:
        return AGREES
    return HIGHER if row["rate"] > row["implied_high"] else LOWER
