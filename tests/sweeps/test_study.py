"""What the study asks, and what it keeps of each trial."""

import json
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import ChangedError
from sweeps.journal import JOURNAL, entries
from sweeps.space import Fields
from sweeps.spec import SweepSpec
from sweeps.study import SweepStudy, result_of
from tests.sweeps.tiny import promised, sweep_in, tiny_sweep

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


ASKED, TOLD, METRIC = 4, 6, 8
"""Operations of Optuna's journal."""


def test_every_metric_is_a_column_of_a_dashboard(finished: Path) -> None:
    """A column shows a user attribute, and cannot show what lies inside one."""
    frame = SweepStudy(tiny_sweep(), finished / "sweep").study.trials_dataframe()
    wanted = {"gain", "gain_low", "gain_high", "score", "no_stitch", "imagined", "pruned", "method"}
    assert {f"user_attrs_{name}" for name in wanted} <= {*frame.columns}
    told = json.loads((finished / "sweep" / "trials.json").read_text())
    assert list(frame["user_attrs_gain_low"]) == [trial["gain_low"] for trial in told]


def test_all_metrics_of_a_batch_are_there_before_one_is_told(finished: Path) -> None:
    whole = {
        trial.number: {*trial.user_attrs}
        for trial in SweepStudy(tiny_sweep(), finished / "sweep").trials
    }
    written: dict[int, set[str]] = {}
    for entry in entries(finished / "sweep" / JOURNAL):
        if entry["op_code"] == ASKED:
            written[len(written)] = set()
        elif entry["op_code"] == METRIC:
            written[entry["trial_id"]] |= {*entry["user_attr"]}
        elif entry["op_code"] == TOLD:
            assert all(names == whole[number] for number, names in written.items())
    assert len(written) == len(whole) == 10


def test_a_journal_of_an_earlier_version_is_read_and_goes_on(
    done: Path, expected: dict[str, object]
) -> None:
    """It has all metrics of a trial as one attribute."""
    path, sweep = done / "sweep" / JOURNAL, tiny_sweep()
    results = [result_of(trial) for trial in SweepStudy(sweep, path.parent).trials]
    lines = []
    for entry in entries(path):
        if entry["op_code"] == METRIC:
            if "method" not in entry["user_attr"]:
                continue
            entry["user_attr"] = {"result": results[entry["trial_id"]]}
        lines.append(json.dumps(entry) + "\n")
    path.write_text("".join(lines[:-6]))  # the last two trials are missing
    sweep_in(done, sweep)
    found = promised(done, sweep)
    assert found["study"][0]["user_attrs"].keys() == {"result"}
    assert found["trials.json"] == expected["trials.json"]
    assert found["winner.json"] == expected["winner.json"]
