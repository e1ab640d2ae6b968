"""Deletes from a store what none of the given run directories needs."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path

from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec
from orchestrator.spec.suite import suite_of
from orchestrator.storage import locking
from orchestrator.storage.claim import spec_of
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Store
from orchestrator.work.plan import make_plan

SECONDS_TO_WRITE = 3600


def collect_garbage(store_root: Path, runs: Sequence[Path], *, delete: bool) -> Iterator[str]:
    """Say, and with `delete` remove, artifacts and blocks that no plan of `runs` names.

    Raises UsageError for a path that is no run directory, or no store: a typing error must not cost
    artifacts. Raises LockedError, with `delete`, while a run or sweep uses the store.
    """
    if not runs:
        raise UsageError("name the run directories to keep, for example runs/table1-paper")
    for run in map(RunDirectory, runs):
        run.asked()
    if not (store_root / "blocks.sqlite").is_file():
        raise UsageError(f"{store_root} is no store: it has no blocks.sqlite")
    with locking.alone(store_root) if delete else nullcontext():
        needed: set[str] = set()
        for run in map(RunDirectory, runs):
            needed |= _of_suite(run) if run.is_suite else _of_run(run)
        yield from _collect(Store(store_root), needed, delete=delete)


def _collect(store: Store, needed: set[str], *, delete: bool) -> Iterator[str]:
    verb = "deleted" if delete else "would delete"
    freed = 0
    for kind, key in list(store.artifacts()):
        if key not in needed:
            folder = store.path(kind, key)
            freed += _size(folder)
            if delete:
                shutil.rmtree(folder)
            yield f"{verb} {folder}"
    for leftovers in (store.root / "incoming", store.root / "corrupt"):
        for folder in sorted(leftovers.glob("*")):
            if time.time() - folder.stat().st_mtime < SECONDS_TO_WRITE:
                continue  # somebody may be writing it
            freed += _size(folder)
            if delete:
                shutil.rmtree(folder)
            yield f"{verb} {folder}"
    for key, folder in list(store.unfinished()):
        if key not in needed:
            freed += _size(folder)
            if delete:
                store.drop_checkpoints(key)
            yield f"{verb} {folder}"
    shared = Ledger(store.root / "blocks.sqlite")
    stale = shared.finished() - needed
    if delete:
        shared.forget(stale)
        shared.shrink()
    shared.close()
    yield f"{verb} {len(stale)} blocks; artifacts freed {freed / 1e6:.1f} MB"
    if not delete:
        yield "nothing was touched; add --delete to do it"


def _of_run(directory: RunDirectory) -> set[str]:
    needed = _planned(spec_of(directory))
    # The run may have been made by other code, under which the same things had other names.
    ledger = directory.ledger(read_only=True)
    needed |= ledger.artifacts().keys() | ledger.finished()
    ledger.close()
    return needed


def _of_suite(directory: RunDirectory) -> set[str]:
    """All that its parts need, those included that have not begun."""
    needed: set[str] = set()
    for part in suite_of(directory).parts:
        run = directory.part(part.label)
        begun = (run.path / "ledger.sqlite").is_file()
        needed |= _of_run(run) if begun else _planned(part.spec)
    return needed


def _planned(spec: Spec) -> set[str]:
    plan = make_plan(spec)
    return set(plan.recipes) | {task.key for task in plan.tasks.values()}


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
