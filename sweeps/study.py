"""The Optuna study of a sweep: asked and told by one driver, in a journal that survives a kill.

A trial is written whole when it is asked for, and RUNNING until it is told. The driver alone owns
the study, so after a kill it goes on with its own RUNNING trials: none is lost, doubled or left.
What is asked depends on the finished trials and on the trial's number, never on how often the
process was killed or how many workers there are.
"""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Mapping
from copy import copy as shallow_copy
from pathlib import Path
from typing import Any

import optuna
from optuna.exceptions import ExperimentalWarning
from optuna.pruners import WilcoxonPruner
from optuna.samplers import BaseSampler, RandomSampler, TPESampler
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.study import StudyDirection
from optuna.trial import FrozenTrial, TrialState, create_trial

from orchestrator.errors import ChangedError, StorageError
from orchestrator.storage.store import make_folder, storage_errors
from stitching.streams import stream
from sweeps.questions import METRICS
from sweeps.space import Fields, current, describe
from sweeps.spec import SweepSpec, base_spec

RESULT = "result"  # user attribute: a trial's metrics, there before any of its batch is told
JOURNAL = "study.journal"
STALE_SECONDS = 3  # an append takes milliseconds: a lock held for longer was left by a kill


def repair(path: Path) -> int:
    """Cut a torn last line, which a kill can leave, from a journal; returns the bytes cut.

    Optuna appends behind it otherwise, and nothing can be read any more. Raises StorageError for
    damage elsewhere, and for a file that cannot be written.
    """
    make_folder(path.parent)
    with storage_errors(path):
        with path.open("ab"):  # refused here, before anything is played for nothing
            pass
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        for number, line in enumerate(whole.splitlines(), start=1):
            _check_line(path, number, line)
        if len(whole) < len(data):
            with path.open("r+b") as file:
                file.truncate(len(whole))
    return len(data) - len(whole)


def _check_line(path: Path, number: int, line: bytes) -> None:
    try:
        json.loads(line)
    except ValueError as error:
        raise StorageError(
            f"{path}, line {number}: damaged ({error}); restore the file, or move it away: the "
            "same command then asks the same trials again and finds the blocks they have played"
        ) from error


class SweepStudy:
    """Asks for batches of trials and tells their results."""

    def __init__(self, sweep: SweepSpec, folder: Path) -> None:
        self.sweep = sweep
        self.path = (folder / JOURNAL).resolve()
        self.cut = repair(self.path)
        optuna.logging.set_verbosity(logging.WARNING)
        lock = JournalFileOpenLock(str(self.path), grace_period=STALE_SECONDS)
        backend = JournalFileBackend(str(self.path), lock)
        with storage_errors(self.path):
            self.study = _open(JournalStorage(backend), sweep)
        self._check_enqueued()

    @property
    def trials(self) -> list[FrozenTrial]:
        return self.study.get_trials(deepcopy=False)

    @property
    def finished(self) -> list[FrozenTrial]:
        """Told trials, given-up ones included."""
        return [trial for trial in self.trials if trial.state == TrialState.COMPLETE]

    def next_batch(self) -> list[FrozenTrial]:
        """The trials to be played now: left running by a kill, or newly asked; none at the end."""
        running = [trial.number for trial in self.trials if trial.state == TrialState.RUNNING]
        first = min(running, default=len(self.trials))
        size = self.sweep.batch
        end = min((first // size + 1) * size, self.sweep.budget)
        while len(self.trials) < end:
            self._ask(len(self.trials))
        return [t for t in self.trials[:end] if t.state == TrialState.RUNNING]

    def handle(self, trial: FrozenTrial) -> optuna.Trial:
        """What results are written through."""
        return optuna.Trial(self.study, trial._trial_id)

    def keep(self, trial: FrozenTrial, result: Mapping[str, Any]) -> None:
        """Write a trial's metrics down, and whether it keeps to the constraints."""
        handle = self.handle(trial)
        for metric, most in self.sweep.constraints.items():
            if metric not in trial.constraints:
                handle.set_constraint(metric, result[metric] - most)
        handle.set_user_attr(RESULT, dict(result))

    def tell(self, batch: list[FrozenTrial]) -> None:
        """Finish trials whose results are all kept, in the order of their numbers."""
        for trial in batch:
            result = self.trials[trial.number].user_attrs[RESULT]
            values = [result.get(expected(name), result[name]) for name in self.sweep.objectives]
            self.study.tell(trial.number, values)

    def fields(self, trial: FrozenTrial) -> Fields:
        """A trial's values by field of the run spec, in the space's order."""
        return {path: trial.params[path] for path in self.sweep.space}

    def ranked(self) -> list[FrozenTrial]:
        """Finished trials that keep to the constraints and were not given up, best first.

        By the first objective; of equals, the earlier one is the better.
        """
        sign = -1 if METRICS[self.sweep.objectives[0]].maximised else 1
        kept = [t for t in self.finished if feasible(t) and not t.user_attrs[RESULT]["pruned"]]
        return sorted(kept, key=lambda trial: (sign * trial.values[0], trial.number))

    def _check_enqueued(self) -> None:
        """ChangedError for a setting that would be passed over: its number has another already."""
        for trial, setting in zip(self.trials, self.sweep.enqueued, strict=False):
            if (before := self.fields(trial)) != setting:
                raise ChangedError(
                    f"{self.path}: enqueued, {trial.number}: trial {trial.number} was asked with "
                    f"{describe(before)}; enqueue others behind the {len(self.trials)} trials that "
                    "there are, or choose another --out"
                )

    def _ask(self, number: int) -> None:
        """Add one trial to the journal, whole."""
        space = {path: dimension.distribution for path, dimension in self.sweep.space.items()}
        self.study.add_trial(
            create_trial(
                state=TrialState.RUNNING, params=self._sampled(number), distributions=space
            )
        )

    def _sampled(self, number: int) -> Fields:
        sweep = self.sweep
        if points := sweep.points:
            return points[number]
        if number < len(sweep.enqueued):
            return {path: sweep.enqueued[number][path] for path in sweep.space}
        if number == 0 and sweep.base_first:
            base = base_spec(sweep)
            values = {path: current(base, path) for path in sweep.space}
            own = {path: value for path, value in values.items() if value is not None}
            if own.keys() == values.keys() and all(sweep.space[p].holds(own[p]) for p in own):
                return own
        # On a copy, for there a trial may be written piece by piece.
        copy = optuna.create_study(directions=directions(sweep), sampler=sampler(sweep, number))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            copy.add_trials([_bare(trial) for trial in self.trials])
        asked = copy.ask({path: dimension.distribution for path, dimension in sweep.space.items()})
        return dict(asked.params)


def _bare(trial: FrozenTrial) -> FrozenTrial:
    """What samplers look at, without the instances, of which there may be thousands."""
    bare = shallow_copy(trial)
    bare.intermediate_values, bare.user_attrs = {}, {}
    return bare


def _open(storage: JournalStorage, sweep: SweepSpec) -> optuna.Study:
    never_asked = RandomSampler(seed=0)  # see `SweepStudy._sampled`
    if sweep.name in optuna.get_all_study_names(storage):
        return optuna.load_study(study_name=sweep.name, storage=storage, sampler=never_asked)
    study = optuna.create_study(
        storage=storage,
        study_name=sweep.name,
        directions=directions(sweep),
        sampler=never_asked,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        study.set_metric_names(list(sweep.objectives))  # what dashboards call them
    return study


def expected(metric: str) -> str:
    """Name in a given-up trial's result of what the metric would be, had it been played out."""
    return f"expected_{metric}"


def directions(sweep: SweepSpec) -> list[StudyDirection]:
    """Which way each objective is better, as Optuna has it."""
    return [
        StudyDirection.MAXIMIZE if METRICS[name].maximised else StudyDirection.MINIMIZE
        for name in sweep.objectives
    ]


def sampler(sweep: SweepSpec, number: int) -> BaseSampler:
    """A sampler for one trial: its randomness belongs to the sweep's seed and the number."""
    seed = int(stream("sampler", sweep.seed, number).integers(2**32))
    if sweep.sampler == "random":
        return RandomSampler(seed=seed)
    return TPESampler(n_startup_trials=sweep.startup, seed=seed, constant_liar=True)


def wilcoxon(sweep: SweepSpec) -> WilcoxonPruner:
    """The pruner that gives up what is worse task by task."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExperimentalWarning)
        return WilcoxonPruner(p_threshold=sweep.pruner.p, n_startup_steps=sweep.pruner.startup)


def feasible(trial: FrozenTrial) -> bool:
    """Whether a trial meets every constraint."""
    return all(excess <= 0 for excess in trial.constraints.values())
