"""Whatever happens to the process, the study comes out the same."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import pytest
from optuna.storages.journal import JournalFileBackend

from orchestrator.errors import BadDataError, ChangedError, LockedError, StorageError
from orchestrator.spec.structure import merged
from orchestrator.storage.rundir import RunDirectory
from orchestrator.work import evaluation
from sweeps.journal import JOURNAL, repair
from sweeps.spec import Confirm, Pruner
from sweeps.study import SweepStudy
from tests.orchestrator.benchmarks.written import maze_demonstrations, write_maze
from tests.orchestrator.tiny import Lines
from tests.sweeps.tiny import TINY_SWEEP, promised, sweep_in, tiny_sweep

SWEEP = tiny_sweep()
PRUNER = Pruner(rounds=3, p=0.4, startup=4)


class Killed(BaseException):
    """Ends a process in the middle of anything."""


def journal_lines(root: Path) -> int:
    path = root / "sweep" / JOURNAL
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def test_the_same_study_for_any_bundling(
    trained: Path, expected: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Blocks go to workers one by one, and so in another order."""
    monkeypatch.setattr(evaluation, "LARGEST_BUNDLE", 1)
    sweep_in(trained, SWEEP)
    assert promised(trained, SWEEP) == expected


@pytest.mark.ray
def test_the_same_study_from_two_workers(trained: Path, expected: dict[str, Any]) -> None:
    sweep_in(trained, SWEEP, executor="ray", workers=2)
    assert promised(trained, SWEEP) == expected


def test_again_plays_nothing(done: Path, expected: dict[str, Any]) -> None:
    before = (done / "sweep" / "counts.json").read_bytes()
    sweep_in(done, SWEEP)
    assert promised(done, SWEEP) == expected
    assert (done / "sweep" / "counts.json").read_bytes() == before


@pytest.mark.parametrize("pruned", [False, True])
def test_killed_at_every_seventh_write_to_the_journal(
    trained: Path, expected: dict[str, Any], monkeypatch: pytest.MonkeyPatch, pruned: bool
) -> None:
    sweep = tiny_sweep(pruner=PRUNER) if pruned else SWEEP
    if pruned:
        undisturbed = trained.parent / "undisturbed"
        shutil.copytree(trained, undisturbed)
        sweep_in(undisturbed, sweep)
        expected = promised(undisturbed, sweep)
    append, written = JournalFileBackend.append_logs, [0]

    def append_and_die(self: Any, logs: Any) -> None:
        append(self, logs)
        written[0] += 1
        if written[0] % (20 if pruned else 7) == 0:
            raise Killed

    monkeypatch.setattr(JournalFileBackend, "append_logs", append_and_die)
    deaths = 0
    while True:
        try:
            sweep_in(trained, sweep)
            break
        except Killed:
            deaths += 1
    assert deaths > 3
    assert promised(trained, sweep) == expected


def test_killed_five_times_for_good(trained: Path, expected: dict[str, Any]) -> None:
    """SIGKILL to the real command, at no chosen moment."""
    places = ["--out", trained / "sweep", "--store", trained / "store"]
    how = ["--executor", "serial", "--tracking-uri", "none", "--results", trained / "results"]
    command = [sys.executable, "-m", "orchestrator.cli", "sweep", TINY_SWEEP, *places, *how]
    for kill in range(1, 6):
        lines = journal_lines(trained)
        said = trained / f"said-{kill}.txt"
        with said.open("w") as stream:
            process = subprocess.Popen(list(map(str, command)), stderr=stream)
        while journal_lines(trained) < lines + 1 + kill % 2 and process.poll() is None:
            time.sleep(0.01)
        assert process.poll() is None, f"it was to be killed in the middle:\n{said.read_text()}"
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    sweep_in(trained, SWEEP)
    assert promised(trained, SWEEP) == expected


def test_a_torn_line_is_cut_and_nothing_is_lost(done: Path, expected: dict[str, Any]) -> None:
    path = done / "sweep" / JOURNAL
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"op_code":6,"trial')
    lines = Lines()
    sweep_in(done, SWEEP, lines)
    assert "cut 19 bytes of a line torn by a kill" in lines.text
    assert path.read_bytes() == whole
    assert promised(done, SWEEP) == expected


def test_a_journal_torn_anywhere_ends_the_same(done: Path, expected: dict[str, Any]) -> None:
    path = done / "sweep" / JOURNAL
    path.write_bytes(path.read_bytes()[:-1000])
    sweep_in(done, SWEEP)
    assert promised(done, SWEEP) == expected


def test_a_lock_left_by_a_kill_holds_nobody_up(done: Path) -> None:
    """Optuna's own, which it takes to be somebody's for half a minute unless told otherwise."""
    study = SweepStudy(SWEEP, done / "sweep")
    lock = study.path.with_name(f"{JOURNAL}.lock")
    lock.touch()
    began = time.monotonic()
    study.study.set_user_attr("seen", True)
    assert not lock.exists()
    assert time.monotonic() - began < 20


def test_damage_in_the_middle_is_named(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    path.write_bytes(b'{"op_code":0}\n\0\0\0\0\n{"op_code":3}\n')
    with pytest.raises(StorageError, match=r"study\.journal, line 2: damaged"):
        repair(path)
    assert path.read_bytes().count(b"\n") == 3


def test_a_journal_that_cannot_be_written_is_named(
    done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = done / "sweep" / JOURNAL
    path.chmod(0o444)
    if os.geteuid() == 0:  # root may write to read-only files
        original = Path.open

        def refuse(self: Path, mode: str = "r", *args: Any, **kwargs: Any) -> Any:
            if self.name == JOURNAL and mode != "rb":
                raise PermissionError(13, "Permission denied")
            return original(self, mode, *args, **kwargs)

        monkeypatch.setattr(Path, "open", refuse)
    before = path.read_bytes()
    with pytest.raises(StorageError, match=r"study\.journal: Permission denied"):
        sweep_in(done, SWEEP)
    assert path.read_bytes() == before


def test_another_study_is_refused_and_a_larger_budget_is_not(
    done: Path, expected: dict[str, Any]
) -> None:
    with pytest.raises(ChangedError, match="seed: 0 → 1"):
        sweep_in(done, tiny_sweep(seed=1))
    larger = tiny_sweep(trials=12)
    sweep_in(done, larger)
    told = promised(done, larger)["study"]
    assert len(told) == 12
    assert told[:10] == expected["study"]


def test_what_is_refused_changes_no_file(done: Path) -> None:
    """By the journal, too: a finished sweep stays finished."""
    other = tiny_sweep(enqueued=(dict.fromkeys(SWEEP.space, 3),))
    refused = {"damaged": (SWEEP, StorageError), "enqueued": (other, ChangedError)}
    journal = done / "sweep" / JOURNAL
    whole = journal.read_bytes()
    for name, (sweep, error) in refused.items():
        journal.write_bytes(b"\0\n" + whole if name == "damaged" else whole)
        before = {path: path.read_bytes() for path in (done / "sweep").glob("*.json")}
        with pytest.raises(error):
            sweep_in(done, sweep)
        assert {path: path.read_bytes() for path in (done / "sweep").glob("*.json")} == before
        assert RunDirectory(done / "sweep").written


def test_a_study_begun_by_a_killed_command_is_begun_anew(trained: Path) -> None:
    """Before its sweep was written down, which may be another one now."""
    (trained / "sweep").mkdir()
    SweepStudy(tiny_sweep(objectives=("imagined",)), trained / "sweep")
    sweep_in(trained, tiny_sweep(trials=2, batch=2, confirm=Confirm(best=0)))


def test_own_data_that_cannot_be_used_are_told_before_anything_is_claimed(tmp_path: Path) -> None:
    actions = maze_demonstrations().actions.copy()
    actions[5] = np.nan
    file = write_maze(tmp_path / "mine.npz", actions=actions)
    with pytest.raises(BadDataError, match=r"mine\.npz: actions, row 5: not a finite number"):
        sweep_in(
            tmp_path, tiny_sweep(settings=merged(SWEEP.settings, {"data": {"file": str(file)}}))
        )
    assert not (tmp_path / "sweep").exists()


def test_a_second_sweep_at_once_is_refused(done: Path) -> None:
    with RunDirectory(done / "sweep").locked(), pytest.raises(LockedError, match="is in use by"):
        sweep_in(done, SWEEP)


def test_optuna_itself_reads_the_study(done: Path) -> None:
    """As optuna-dashboard does: by name, from the journal."""
    backend = optuna.storages.journal.JournalFileBackend(str(done / "sweep" / JOURNAL))
    study = optuna.load_study(
        study_name="tiny-sweep", storage=optuna.storages.JournalStorage(backend)
    )
    winner = json.loads((done / "sweep" / "winner.json").read_text())
    assert study.metric_names == ["gain"]
    assert study.best_trial.number == winner["trial"]
    assert all(trial.state.is_finished() for trial in study.trials)


def test_what_is_asked_hangs_on_the_number_and_on_what_was_told(tmp_path: Path) -> None:
    asked = []
    for name in ("once", "piecemeal"):
        for _ in range(1 if name == "once" else 3):
            batch = SweepStudy(SWEEP, tmp_path / name).next_batch()
        asked.append([trial.params for trial in batch])
    assert asked[0] == asked[1]
    assert len(asked[0]) == SWEEP.batch
