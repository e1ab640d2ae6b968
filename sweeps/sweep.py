"""One sweep from beginning to end: search, confirm, write up, track."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

from analysis.schema import PROVENANCE
from orchestrator.errors import ChangedError, UsageError
from orchestrator.reproduction import LazyExecutor, Settings
from orchestrator.spec.spec import differences
from orchestrator.spec.structure import Plain, structure, to_plain
from orchestrator.storage import locking
from orchestrator.storage.claim import claim, is_unused, spec_of
from orchestrator.storage.claim import describe as describe_spec
from orchestrator.storage.datasets import check_own_data
from orchestrator.storage.provenance import provenance
from orchestrator.storage.rundir import PLANNED, SWEEP, RunDirectory
from orchestrator.storage.store import Store, storage_errors
from orchestrator.work.plan import Plan, make_plan
from orchestrator.work.progress import Progress
from sweeps.confirm import confirm
from sweeps.journal import JOURNAL
from sweeps.player import CountingExecutor, SpecPlayer
from sweeps.results.again import SOURCE
from sweeps.results.report import write_report
from sweeps.results.table import write_table
from sweeps.results.tracking import Tracker
from sweeps.search import run_search, search_spec
from sweeps.space import describe
from sweeps.spec import SweepSpec
from sweeps.study import SweepStudy, feasible, result_of

MAY_CHANGE = ("trials", "enqueued", "confirm", "title", "tables")  # under a study that goes on


def default_out(sweep: SweepSpec) -> Path:
    """runs/sweep-<name>-<scale>."""
    return Path("runs") / f"sweep-{sweep.name}-{sweep.scale}"


def carry_out(
    sweep: SweepSpec,
    settings: Settings,
    progress: Progress,
    results: Path | None = None,
    *,
    force: bool = False,
    source: str = "",
) -> RunDirectory:
    """Search, or go on where an earlier command ended; returns the sweep's directory.

    study.journal     the Optuna study, for optuna-dashboard too
    sweep.json        what was asked
    source.json       the name or file that it was read from
    plan.json         the artifacts that all trials share
    trials.json       every finished trial with its result
    confirm.json      the best ones on held-out tasks and new seeds
    winner.json       for `skillstitch run … --from-sweep`
    counts.json       what was trained and simulated for it; all else was found
    table/            of a grid: all its points as one run, with the usual tables
    report/           index.html, index.md, trials.csv, confirm.csv, figures
    finished          there when all of the above is

    `results`, `force`: see `write_report`. source: by default its name. Raises what a reproduction
    raises; IncompleteError loses nothing.
    """
    spec = search_spec(sweep)
    plan = make_plan(spec)
    check_own_data(plan, Store(settings.store))
    directory = RunDirectory(settings.out)
    with directory.locked(), locking.shared(settings.store, progress.say):
        run_id = claim(
            directory, describe_spec(spec), [plan], lambda: differences(spec_of(directory), spec)
        )
        check_same(directory, sweep)
        study = SweepStudy(sweep, directory.path)  # which may refuse what has been changed, too
        directory.write_json(SWEEP, _asked(sweep))
        directory.mark(finished=False)
        directory.write_json(SOURCE, source or sweep.name)
        directory.write_json(PLANNED, _shared_artifacts(plan, sweep))
        directory.uses(settings.store)
        if study.cut:
            progress.say(f"{study.path}: cut {study.cut} bytes of a line torn by a kill")
        ledger = directory.ledger()
        earlier = directory.read_json("counts.json") or {}
        player = SpecPlayer(settings.store, ledger, LazyExecutor(settings), progress)
        tracker = Tracker(settings.resolved_tracking_uri(), directory, run_id, progress)
        with (
            tracker.told(),
            closing(ledger),
            _counted(directory, player, earlier),
            storage_errors(directory.path),
        ):
            if sweep.question.shared:  # else every trial has its own models, as it comes
                player.prepare([spec])
            with player.quietly():
                for _ in run_search(sweep, study, player, progress):
                    _write_results(directory, study, player.executor, earlier)
            _write_results(directory, study, player.executor, earlier)
            directory.write_json("confirm.json", confirm(sweep, study, player))
            directory.write_json("winner.json", winner(directory, study))
            directory.write_json(PROVENANCE, provenance() | {"run_id": run_id})
            if sweep.tables:
                with player.quietly():
                    write_table(sweep, player, directory.path / "table")
            _write_counts(directory, player.executor, earlier)
            write_report(sweep, study, directory, results, force=force)
            directory.mark(finished=True)
    return directory


def report_again(directory: RunDirectory, results: Path | None, *, force: bool = False) -> None:
    """Write the report of the trials that are finished; `results`, `force`: see `write_report`.

    Raises UsageError where no trial is.
    """
    sweep = structure(SweepSpec, directory.asked_sweep(), str(directory.path / SWEEP))
    with directory.locked(), storage_errors(directory.path):
        study = SweepStudy(sweep, directory.path)
        if study.trials:  # whose fields are in the order asked; those of sweep.json are sorted
            space = {path: sweep.space[path] for path in study.trials[0].params}
            study.sweep = sweep = replace(sweep, space=space)
        _write_trials(directory, study)
        winner(directory, study)
        write_report(sweep, study, directory, results, force=force)


def check_same(directory: RunDirectory, sweep: SweepSpec) -> None:
    """Raise ChangedError where the directory's study is of another sweep.

    One of which nothing was played is removed instead.
    """
    asked, before = _asked(sweep), directory.asked_sweep()
    changed = [
        f"{name}: {before.get(name)!r} → {value!r}"
        for name, value in asked.items()
        if before is not None and name not in MAY_CHANGE and before.get(name) != value
    ]
    begun = before is None  # at most: a kill may have come before sweep.json was written
    if (changed or begun) and is_unused(directory):
        (directory.path / JOURNAL).unlink(missing_ok=True)
    elif changed:
        raise ChangedError(
            f"{directory.path} holds another study; choose another --out (finished blocks are "
            "shared), or go back to:\n  " + "\n  ".join(changed)
        )


def _asked(sweep: SweepSpec) -> Plain:
    """As sweep.json has it."""
    plain: Plain = json.loads(json.dumps(to_plain(sweep)))
    return plain | {"trials": sweep.budget}


def _shared_artifacts(plan: Plan, sweep: SweepSpec) -> Plain:
    """What `skillstitch status` counts: nothing where every trial has models of its own."""
    shared = plan.needed if sweep.question.shared else ()
    return {"artifacts": [[plan.recipes[key].kind, key] for key in sorted(shared)]}


def winner(directory: RunDirectory, study: SweepStudy) -> Plain:
    """The search's best trial, and what confirmation says of it."""
    best = study.ranked()[:1]
    if not best:
        raise UsageError(
            f"{directory.path}: no trial is finished that keeps to the constraints; go on with the "
            "sweep, or loosen them under another --out"
        )
    confirmed = (directory.read_json("confirm.json") or {}).get("trials", [{}])[0]
    return {
        "sweep": study.sweep.name,
        "base": study.sweep.base,
        "benchmark": spec_of(directory).benchmark,
        "trial": best[0].number,
        "fields": study.fields(best[0]),
        "search": result_of(best[0]),
        "confirmed": confirmed,
    }


def _write_results(
    directory: RunDirectory, study: SweepStudy, executor: CountingExecutor, earlier: Plain
) -> None:
    _write_trials(directory, study)
    _write_counts(directory, executor, earlier)


def _write_trials(directory: RunDirectory, study: SweepStudy) -> None:
    trials = [
        {
            "trial": trial.number,
            "fields": study.fields(trial),
            "setting": describe(study.fields(trial)),
            "feasible": feasible(trial),
        }
        | result_of(trial)
        for trial in study.finished
    ]
    directory.write_json("trials.json", trials)


@contextmanager
def _counted(directory: RunDirectory, player: SpecPlayer, earlier: Plain) -> Iterator[None]:
    """However the work within it ends, what it did is counted, and the player closed."""
    try:
        yield
    finally:
        _write_counts(directory, player.executor, earlier)
        player.close()


def _write_counts(directory: RunDirectory, executor: CountingExecutor, earlier: Plain) -> None:
    """What this command did, on top of what the commands before it did."""
    counts: Plain = {}
    for name, own in executor.counts().items():
        before = earlier.get(name, {})
        counts[name] = {k: before.get(k, 0) + own.get(k, 0) for k in sorted({*before, *own})}
    directory.write_json("counts.json", counts)
