"""A suite from beginning to end: its parts one after the other, then the tables over them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from analysis.report import build_report
from orchestrator.errors import IncompleteError, SkillstitchError
from orchestrator.executors import open_executor
from orchestrator.reproduction import Settings, partial_error, reproduce, tracked
from orchestrator.spec.spec import Spec
from orchestrator.spec.suite import Suite, suite_differences, suite_of
from orchestrator.storage import locking
from orchestrator.storage.claim import claim, refuse_sweep
from orchestrator.storage.datasets import check_own_data
from orchestrator.storage.merge import describe_suite, write_merged
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Store, storage_errors
from orchestrator.work.plan import make_plan
from orchestrator.work.progress import Progress
from orchestrator.work.stopwatch import Stopwatch


def reproduce_asked(asked: Spec | Suite, settings: Settings, progress: Progress) -> RunDirectory:
    """Carry out a spec or a suite, as `reproduce` and `reproduce_suite` do."""
    if isinstance(asked, Suite):
        return reproduce_suite(asked, settings, progress)
    return reproduce(asked, settings, progress)


def reproduce_suite(suite: Suite, settings: Settings, progress: Progress) -> RunDirectory:
    """Carry a suite out, or go on where an earlier command ended; returns its directory.

    Raises what `reproduce` does, naming the part; IncompleteError when parts had to give up blocks
    (all else is then finished, and the tables are marked as partial).
    """
    directory, watch = RunDirectory(settings.out), Stopwatch()
    plans = [make_plan(part.spec) for part in suite.parts]
    for plan in plans:
        check_own_data(plan, Store(settings.store))
    with directory.locked(), locking.shared(settings.store, progress.say):
        refuse_sweep(directory)
        run_id = claim(
            directory,
            describe_suite(suite),
            plans,
            lambda: suite_differences(suite_of(directory), suite),
        )
        directory.uses(settings.store)
        parts = {part.label: directory.part(part.label) for part in suite.parts}
        done = directory.finished and all(part.finished for part in parts.values())
        if not done:
            directory.mark(finished=False)
        with tracked(directory, settings, progress, watch):
            gave_up = _carry_out_parts(suite, settings, parts, progress, watch)
            if not done:
                with storage_errors(directory.path), progress.step("report of all parts"):
                    write_merged(suite, directory, run_id)
                    build_report(directory.path)
                directory.mark(finished=True)
                watch.lap("report of all parts")
        if not done:
            directory.write_json("seconds.json", watch.rounded())
        if gave_up:
            raise partial_error(f"blocks of {', '.join(gave_up)}", directory)
    return directory


def _carry_out_parts(
    suite: Suite,
    settings: Settings,
    parts: dict[str, RunDirectory],
    progress: Progress,
    watch: Stopwatch,
) -> list[str]:
    """Every part in turn; returns the labels of those that gave up blocks."""
    partial = []
    with _workers_kept(settings, all(part.played for part in parts.values()), progress):
        for number, part in enumerate(suite.parts, start=1):
            directory = parts[part.label]
            progress.say(f"part {part.label} ({number} of {len(suite.parts)}): {directory.path}")
            try:
                reproduce(part.spec, replace(settings, out=directory.path), progress)
            except SkillstitchError as error:
                gave_up = isinstance(error, IncompleteError)
                if not (gave_up and directory.written):
                    raise type(error)(f"part {part.label}: {error}") from error
                partial.append(part.label)
            watch.lap(f"part {part.label}")
    return partial


@contextmanager
def _workers_kept(settings: Settings, nothing_to_do: bool, progress: Progress) -> Iterator[None]:
    """Ray is started once for all parts: executors opened meanwhile join it."""
    if settings.executor == "serial" or nothing_to_do:
        yield
        return
    with progress.step("starting workers"):
        executor = open_executor(
            settings.executor, settings.workers, settings.address, settings.dashboard
        )
    try:
        yield
    finally:
        executor.close()
