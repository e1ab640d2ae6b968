"""How to make a run again: the command, and what was set otherwise than usual."""

import shlex
from html import escape
from typing import Any

from analysis.page.tables import html_table
from analysis.schema import RunSpec
from analysis.tables.writers import markdown_table

TITLE = "How to make it again"
FILE_HEADER = ["Field", "Here", "In the packaged file"]
DEFAULT_HEADER = ["Field", "Here", "Default"]
UNKNOWN = (
    "An earlier version of skillstitch made this run, and did not keep the command that does it "
    "again. spec.json beside it has all of its settings."
)
NO_OPTION = (
    "No command alone asks for this: what is below cannot be set so by options. spec.json has all "
    "of its settings."
)
OWN_FILE = (
    "It was described by a file of somebody's own, for no packaged one has this name and scale: "
    "skillstitch run with that file does it again. spec.json has all of its settings."
)
DEFAULTS = "Settings that differ from their defaults, of methods and planners that were used"


def _told(spec: RunSpec) -> tuple[str, str, str]:
    """What is said, the command, and what is said of changes to the packaged file."""
    origin = spec.origin
    if origin is None:
        return UNKNOWN, "", ""
    if not origin.packaged:
        return OWN_FILE, "", ""
    packaged = f"in the packaged file {origin.packaged} at scale {spec.scale}"
    changes = f"Otherwise than {packaged}:" if origin.changed else f"All is as {packaged}."
    if not origin.command:
        return NO_OPTION, "", changes
    return "This command makes it again:", shlex.join(origin.command), changes


def origin_section(spec: RunSpec) -> str:
    """The command, and tables of the settings that are not as usual."""
    said, command, changes = _told(spec)
    html = f'<p class="note">{escape(said)}</p>'
    if command:
        html += f"<pre><code>{escape(command)}</code></pre>"
    origin = spec.origin
    if changes:
        html += f'<p class="note">{escape(changes)}</p>'
    if origin and origin.changed:
        html += html_table(FILE_HEADER, _lines(origin.changed))
    if origin and origin.defaults:
        html += (
            f"<details><summary>{DEFAULTS} ({len(origin.defaults)})</summary>"
            f"{html_table(DEFAULT_HEADER, _lines(origin.defaults))}</details>"
        )
    return html


def origin_markdown(spec: RunSpec) -> str:
    """The same as Markdown, from its heading on."""
    said, command, changes = _told(spec)
    parts = [f"## {TITLE}", said]
    if command:
        parts.append(f"```\n{command}\n```")
    origin = spec.origin
    if changes:
        parts.append(changes)
    if origin and origin.changed:
        parts.append(markdown_table(FILE_HEADER, _lines(origin.changed)))
    if origin and origin.defaults:
        parts += [f"{DEFAULTS}:", markdown_table(DEFAULT_HEADER, _lines(origin.defaults))]
    return "\n\n".join(parts) + "\n"


def _lines(differences: tuple[tuple[str, Any, Any], ...]) -> list[list[str]]:
    return [[field, _text(here), _text(there)] for field, here, there in differences]


def _text(value: Any) -> str:
    """As a file would have it; a dash where there is nothing."""
    if value is None or value in ("", []):
        return "–"
    if isinstance(value, bool):
        return str(value).lower()
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
