"""How to make a run again, as the page and the Markdown tell it."""

from dataclasses import replace
from typing import Any

import pytest

from analysis.page.origin import origin_markdown, origin_section
from analysis.schema import Origin, RunSpec

COMMAND = ("skillstitch", "run", "table1", "--scale", "quick", "--tasks", "g0>g1")
CHANGED: tuple[str, Any, Any] = ("tasks", ["g0>g1"], [])
ORIGIN = Origin(
    "table1",
    COMMAND,
    (CHANGED,),
    (CHANGED, ("step_limits.2", 50, None), ("agent.clip", True, False)),
)


def told(spec: RunSpec, origin: Origin | None) -> tuple[str, str]:
    asked = replace(spec, origin=origin)
    return origin_markdown(asked), origin_section(asked)


def test_the_command_can_be_copied(spec: RunSpec) -> None:
    text, html = told(spec, ORIGIN)
    assert "```\nskillstitch run table1 --scale quick --tasks 'g0>g1'\n```" in text
    assert "--scale quick --tasks &#x27;g0&gt;g1&#x27;</code>" in html


def test_every_field_that_differs_is_named(spec: RunSpec) -> None:
    text, html = told(spec, ORIGIN)
    assert "Otherwise than in the packaged file table1 at scale quick:" in text
    assert "| tasks | g0>g1 | – |\n\nSettings that differ from their defaults" in text
    assert "| step_limits.2 | 50 | – |\n| agent.clip | true | false |" in text
    assert html.count('<tr><th scope="row">') == 4
    assert "were used (3)</summary>" in html


def test_nothing_changed_is_said(spec: RunSpec) -> None:
    for told_so in told(spec, Origin("table1", COMMAND)):
        assert "All is as in the packaged file table1 at scale quick." in told_so


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        (None, "An earlier version of skillstitch made this run"),
        (Origin(), "a file of somebody"),
        (Origin("table1", (), (CHANGED,)), "No command alone asks for this"),
    ],
    ids=["earlier", "own file", "no option"],
)
def test_where_there_is_no_command(spec: RunSpec, origin: Origin | None, said: str) -> None:
    for told_so in told(spec, origin):
        assert said in told_so
        assert "<code>" not in told_so
        assert "```" not in told_so
