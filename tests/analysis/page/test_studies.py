"""Sections of the page: what they show where a run has no baseline."""

from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.page.studies import pairs_section
from analysis.run import load_run
from analysis.studies.pairs import both_skills, pair_groups, second_skills
from tests.analysis.kitchen_run import METHODS, ORDERS, kitchen_spec, write_kitchen


def section(
    write_run: Callable[..., Path], folder: Path, methods: list[str], *, own_first_skill: bool
) -> str:
    named = [
        {"name": name, "label": METHODS[name], "own_first_skill": own_first_skill}
        for name in methods
    ]
    run = load_run(write_kitchen(write_run, folder, spec=kitchen_spec() | {"methods": named}))
    seconds, both = second_skills(run.segments, run.spec), both_skills(run.segments, run.spec)
    return pairs_section(run, pair_groups(seconds, both, ORDERS, run.spec))


@pytest.mark.parametrize("own_first_skill", [True, False])
def test_gains_are_shown_where_there_is_a_baseline(
    tmp_path: Path, write_run: Callable[..., Path], own_first_skill: bool
) -> None:
    both = section(write_run, tmp_path / "both", list(METHODS), own_first_skill=own_first_skill)
    assert both.count(">Gain over No-Stitch<") == 2
    alone = section(write_run, tmp_path / "one", ["mb-stitch"], own_first_skill=own_first_skill)
    assert "MB-Stitch" in alone
    assert "gain" not in alone.lower()
