"""Enqueued settings are asked first, and the sampler goes on from there."""

from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import ChangedError
from sweeps.space import Fields
from sweeps.spec import SweepSpec
from sweeps.study import SweepStudy
from tests.sweeps.tiny import tiny_sweep

FIRST, SECOND, THIRD = (
    {"mb_stitch.random_shooting.population": 4, "mb_stitch.alpha": alpha, "mb_stitch.beta": 2.0}
    for alpha in (1.0, 20.0, 3.0)
)


def searching(**changes: Any) -> SweepSpec:
    return tiny_sweep(trials=4, batch=4, **changes)


def asked(sweep: SweepSpec, folder: Path) -> list[Fields]:
    study = SweepStudy(sweep, folder)
    return [study.fields(trial) for trial in study.next_batch()]


def test_enqueued_settings_come_first_and_then_the_sampler_s(tmp_path: Path) -> None:
    """In their order; the base's own setting, otherwise the first, is none of them."""
    sampled = asked(searching(), tmp_path / "sampled")
    found = asked(searching(enqueued=(SECOND, FIRST)), tmp_path / "enqueued")
    assert found[:2] == [SECOND, FIRST]
    assert found[2:] == sampled[2:], "a number's sampler does not know what was enqueued"


def test_more_may_be_enqueued_behind_those_that_were_asked(tmp_path: Path) -> None:
    sweep = tiny_sweep(trials=2, batch=2, enqueued=(FIRST, SECOND))
    asked(sweep, tmp_path)
    grown = searching(enqueued=(FIRST, SECOND, THIRD))
    assert SweepStudy(grown, tmp_path).fields(SweepStudy(grown, tmp_path).next_batch()[2]) == THIRD


@pytest.mark.parametrize("enqueued", [(SECOND, FIRST), (FIRST, SECOND, THIRD)])
def test_what_was_asked_already_cannot_be_enqueued_anew(
    enqueued: tuple[Fields, ...], tmp_path: Path
) -> None:
    asked(searching(enqueued=(FIRST, SECOND)), tmp_path)
    with pytest.raises(ChangedError, match=r"enqueued, \d: trial \d was asked with .*; enqueue"):
        SweepStudy(searching(enqueued=enqueued), tmp_path)
