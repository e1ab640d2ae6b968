"""One thing that the doctor looked at, and how it is said."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from rich.table import Table
from rich.text import Text

Status = Literal["ok", "warn", "fault"]

STYLES = {"ok": "green", "warn": "yellow", "fault": "bold red"}
GIB = 2**30


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; `advice` is empty where all is well."""

    name: str
    status: Status
    found: str
    advice: str = ""


def has_faults(findings: Iterable[Finding]) -> bool:
    """Whether anything must be mended."""
    return any(finding.status == "fault" for finding in findings)


def as_table(findings: Iterable[Finding]) -> Table:
    """For a terminal."""
    table = Table("", "Looked at", "Found", "What to do", box=None)
    for finding in findings:
        status = Text(finding.status, style=STYLES[finding.status])
        # Text, because advice has brackets that rich would take for markup.
        table.add_row(status, finding.name, Text(finding.found), Text(finding.advice))
    return table


def as_lines(findings: Iterable[Finding]) -> list[str]:
    """For logs: "fault  numpy: 2.1.0; run …"."""
    return [
        f"{finding.status:<5}  {finding.name}: {'; '.join(filter(None, said))}"
        for finding in findings
        for said in [(finding.found, finding.advice)]
    ]


def gib(size: int) -> str:
    """A number of bytes in words."""
    return f"{size // GIB} GiB"
