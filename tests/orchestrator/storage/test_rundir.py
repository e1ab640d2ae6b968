"""A run directory: one holder at a time, true to one spec, one version of the code."""

import json
import multiprocessing
import os
import re
import signal
import socket
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from orchestrator.errors import ChangedError, LockedError, StorageError, UsageError
from orchestrator.spec.spec import Spec
from orchestrator.spec.suite import load_asked
from orchestrator.storage.claim import claim_for_spec, describe, spec_of
from orchestrator.storage.rundir import RunDirectory, default_out
from orchestrator.suite_reproduction import reproduce_asked
from orchestrator.work.progress import Silent
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.rollout import RolloutConfig
from tests.orchestrator.tiny import TINY, Place, serially
from tests.sections import section, with_sections


@pytest.fixture
def directory(tmp_path: Path) -> RunDirectory:
    return RunDirectory(tmp_path / "run")


def test_nobody_else_gets_in(directory: RunDirectory) -> None:
    with directory.locked():
        holder = f"process {os.getpid()} on {socket.gethostname()}"
        message = f"{directory.path} is in use by {holder}; .*choose another --out"
        with pytest.raises(LockedError, match=message) as caught, directory.locked():
            pass
        assert caught.value.exit_code == 4
    with directory.locked():
        pass


def test_an_error_lets_go(directory: RunDirectory) -> None:
    with pytest.raises(ZeroDivisionError), directory.locked():
        _ = 1 / 0
    with directory.locked():
        pass


def _hold(path: Path, held: Any) -> None:
    with RunDirectory(path).locked():
        held.set()
        time.sleep(60)


def test_a_kill_lets_go(directory: RunDirectory) -> None:
    context = multiprocessing.get_context("fork")
    held = context.Event()
    holder = context.Process(target=_hold, args=(directory.path, held))
    holder.start()
    assert holder.pid is not None
    assert held.wait(30)
    started = time.monotonic()
    with pytest.raises(LockedError, match=f"process {holder.pid} on"), directory.locked():
        pass
    assert time.monotonic() - started < 1  # at once
    os.kill(holder.pid, signal.SIGKILL)
    holder.join()
    with directory.locked():
        pass


def test_a_second_launch_changes_nothing(spec: Spec, done: Place) -> None:
    def content() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in done.out.rglob("*") if path.is_file()}

    with done.directory.locked():
        before = content()
        with pytest.raises(LockedError):
            done.carry_out(replace(spec, seeds=1))
        assert content() == before


def test_a_place_that_cannot_be_a_directory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for path in (tmp_path / "file", tmp_path / "file" / "run"):
        with (
            pytest.raises(StorageError, match=rf"{path}.*choose another place"),
            RunDirectory(path).locked(),
        ):
            pass


def test_settling(directory: RunDirectory, spec: Spec) -> None:
    run_id = claim_for_spec(directory, spec)
    assert claim_for_spec(directory, spec) == run_id
    assert spec_of(directory) == spec
    assert claim_for_spec(RunDirectory(directory.path.with_name("other")), spec) != run_id


def test_a_kill_while_settling(directory: RunDirectory, spec: Spec) -> None:
    """The spec is there, the identity is not: the directory was never used, anyone may have it."""
    claim_for_spec(directory, spec)
    (directory.path / "identity.json").unlink()
    other = replace(spec, seeds=1)
    claim_for_spec(directory, other)
    assert spec_of(directory) == other


def test_another_spec_is_refused_with_the_difference(done: Place, spec: Spec) -> None:
    changed = with_sections(
        replace(spec, episodes=7, tasks=("g0>g1",)),
        replace(section(spec, MBStitchSettings), alpha=3.0),
    )
    with pytest.raises(ChangedError) as caught:
        done.carry_out(changed)
    assert caught.value.exit_code == 5
    text = str(caught.value)
    assert str(done.out) in text
    assert "choose another --out" in text
    assert "episodes: 6 → 7" in text
    assert "mb_stitch.alpha: 10.0 → 3.0" in text
    assert re.search(r"tasks: \[.*\] → \['g0>g1'\]", text)
    assert "seeds" not in text
    done.carry_out(spec)


def test_another_version_is_refused_naming_it(done: Place, spec: Spec) -> None:
    path = done.out / "identity.json"
    identity = json.loads(path.read_text())
    (code, fingerprint), *_ = [
        item for item in identity["matters"].items() if item[0].startswith("code")
    ]
    now = dict(identity["matters"])
    path.write_text(json.dumps(identity | {"matters": now | {"numpy": "1.0.0", code: "0" * 12}}))
    with pytest.raises(ChangedError) as caught:
        done.carry_out(spec)
    assert caught.value.exit_code == 5
    assert f"numpy: 1.0.0 → {now['numpy']}" in str(caught.value)
    assert f"{code}: {'0' * 12} → {fingerprint}" in str(caught.value)
    assert "torch" not in str(caught.value)


def test_no_run_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=rf"{tmp_path} is no run directory"):
        spec_of(RunDirectory(tmp_path))


def test_what_a_reader_finds_in_the_spec(spec: Spec) -> None:
    text = json.loads(json.dumps(describe(spec)))
    assert text["skills"] == ["g0", "g1", "g2", "g3"]
    assert text["tasks"] == list(spec.tasks)
    assert text["seeds"] == [0, 1]
    assert text["methods"][3] == {
        "name": "mb-stitch", "label": "MB-Stitch", "own_first_skill": False,
        "models": ["agent", "dynamics"],
    }  # fmt: skip
    first = json.loads(
        json.dumps(describe(replace(spec, rollout=RolloutConfig(first_stitch=True))))
    )
    assert [method["own_first_skill"] for method in first["methods"]] == [False, True, False, True]
    assert text["step_limits"] == {"2": 20, "3": 30}


def test_finished_means_with_nothing_given_up(directory: RunDirectory) -> None:
    directory.mark(finished=True)
    assert directory.finished
    directory.write_json("quarantine.json", [{"seed": 0}])
    assert not directory.finished
    directory.write_json("quarantine.json", [])
    directory.mark(finished=False)
    directory.mark(finished=False)
    assert not directory.finished


def test_runs_are_kept_by_name_and_scale(spec: Spec) -> None:
    assert default_out(spec) == Path("runs/tiny-paper")


def test_a_directory_in_which_nothing_was_made_is_claimed_anew(
    directory: RunDirectory, spec: Spec
) -> None:
    """As after an address that was wrong."""
    before = claim_for_spec(directory, spec)
    directory.ledger().close()
    traces = ("tracking.json", "provenance.json", "quarantine.json")
    for name in traces:
        directory.write_json(name, {"of": before})
    other = replace(spec, episodes=7)
    assert claim_for_spec(directory, other) != before
    assert spec_of(directory) == other
    assert not any((directory.path / name).exists() for name in traces)

    with closing(directory.ledger()) as ledger:
        ledger.record_artifact("key", "digest")
    with pytest.raises(ChangedError, match="episodes: 7 → 6"):
        claim_for_spec(directory, spec)


def test_a_finished_directory_without_a_ledger_is_not_claimed_anew(
    directory: RunDirectory, spec: Spec
) -> None:
    claim_for_spec(directory, spec)
    directory.mark(finished=True)
    with pytest.raises(ChangedError, match="episodes: 6 → 7"):
        claim_for_spec(directory, replace(spec, episodes=7))
    assert directory.written


def test_what_is_claimed_anew_is_not_finished(directory: RunDirectory, spec: Spec) -> None:
    claim_for_spec(directory, spec)
    directory.mark(finished=True)
    (directory.path / "identity.json").unlink()
    claim_for_spec(directory, spec)
    assert not directory.written


@pytest.mark.parametrize("asked", [TINY, TINY.with_name("suite.toml")], ids=["spec", "suite"])
def test_a_run_does_not_take_a_sweep_s_directory(place: Place, asked: Path) -> None:
    place.directory.write_json("sweep.json", {"name": "search"})
    with pytest.raises(UsageError, match=rf"{place.out} holds a sweep; choose another --out"):
        reproduce_asked(load_asked(str(asked)), serially(place.out, place.store_root), Silent())
    assert not (place.out / "identity.json").exists()
