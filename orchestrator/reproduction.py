"""One reproduction from beginning to end: plan, build, play, write, report, track."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from analysis.episodes import write_episodes
from analysis.report import build_report
from analysis.schema import PROVENANCE, QUARANTINE
from analysis.studies.data import undemonstrated_note
from orchestrator import tracking
from orchestrator.cores import check_workers
from orchestrator.errors import (
    BadDataError,
    IncompleteError,
    UsageError,
)
from orchestrator.executors import ExecutorKind, open_executor
from orchestrator.executors.protocol import Executor
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from orchestrator.storage import locking
from orchestrator.storage.claim import claim_for_spec, refuse_sweep
from orchestrator.storage.datasets import check_own_data, undemonstrated_skills
from orchestrator.storage.exports import write_readable
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.provenance import provenance
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import USUAL_STORE, Artifact, Store, storage_errors
from orchestrator.tracking.live import Growing, Live
from orchestrator.tracking.run import mark_killed, publish
from orchestrator.work.building import Builds, verified_artifacts
from orchestrator.work.evaluation import Evaluation
from orchestrator.work.jobs import Job, Report
from orchestrator.work.plan import Plan, make_plan
from orchestrator.work.progress import Progress
from orchestrator.work.stopwatch import Stopwatch
from orchestrator.work.trainings import GrowingCurves


@dataclass(frozen=True)
class Settings:
    """Where and how a run is carried out; nothing here may change its results."""

    out: Path
    store: Path = USUAL_STORE
    executor: ExecutorKind = "ray"
    workers: int | None = None  # all cores, or all of the cluster's
    address: str | None = None  # of a Ray cluster
    tracking_uri: str | None = None  # SQLite beside the store; "none" turns tracking off
    dashboard: bool = False  # of a Ray of its own

    def __post_init__(self) -> None:
        check_workers(self.workers, self.address)
        if self.dashboard and (self.executor != "ray" or self.address is not None):
            raise UsageError(
                "--dashboard is for a Ray that is started for this run; a cluster has its own: "
                "`ray start --head --include-dashboard=true`"
            )

    def resolved_tracking_uri(self) -> str:
        return self.tracking_uri or tracking.default_uri(self.store.parent)


@dataclass
class LazyExecutor:
    """Opens the real executor at the first job: a run that finds everything never starts Ray."""

    settings: Settings
    opened: Executor | None = field(default=None)

    def open(self) -> Executor:
        if self.opened is None:
            settings = self.settings
            self.opened = open_executor(
                settings.executor, settings.workers, settings.address, settings.dashboard
            )
        return self.opened

    @property
    def workers(self) -> int:
        return self.open().workers

    def provide(self, key: str, artifact: Artifact) -> None:
        self.open().provide(key, artifact)

    def submit(self, job: Job) -> None:
        self.open().submit(job)

    def next(self) -> Report:
        return self.open().next()

    def close(self) -> None:
        if self.opened is not None:
            self.opened.close()


def reproduce(spec: Spec, settings: Settings, progress: Progress) -> RunDirectory:
    """Carry a spec out, or go on where an earlier run of it ended; returns its directory.

    Raises LockedError, ChangedError, BadDataError, StorageError; UsageError where the directory
    holds a sweep; IncompleteError when blocks had to be given up (everything else is then finished
    and reported as partial).
    """
    directory, watch = RunDirectory(settings.out), Stopwatch()
    check_own_data(make_plan(spec), Store(settings.store))
    with directory.locked(), locking.shared(settings.store, progress.say):
        refuse_sweep(directory)
        run_id = claim_for_spec(directory, spec)
        directory.uses(settings.store)
        with tracked(directory, settings, progress, watch):
            worked = _carry_out(spec, settings, directory, run_id, progress, watch)
        if worked:
            directory.write_json("seconds.json", watch.rounded())
        if given_up := directory.read_json(QUARANTINE):
            raise partial_error(f"{len(given_up)} blocks", directory)
    return directory


@contextmanager
def tracked(
    directory: RunDirectory, settings: Settings, progress: Progress, watch: Stopwatch
) -> Iterator[None]:
    """MLflow is told how the work ended; where it cannot be, that is said and fails nothing."""
    uri = settings.resolved_tracking_uri()
    try:
        yield
        with progress.step("tracking"):
            trouble = publish(directory, uri, "FINISHED")
    except KeyboardInterrupt:
        mark_killed(directory, uri)
        raise
    except Exception:
        publish(directory, uri, "FAILED")
        raise
    if trouble:
        progress.say(f"tracking: {trouble}")
    watch.lap("tracking")


def partial_error(blocks: str, directory: RunDirectory) -> IncompleteError:
    """What to raise of a directory that is finished but for blocks that were given up."""
    return IncompleteError(
        f"{blocks} were given up after repeated failures (see "
        f"{directory.path / 'quarantine.json'}); the tables are marked as partial, and the "
        "same command tries again"
    )


def _carry_out(
    spec: Spec,
    settings: Settings,
    directory: RunDirectory,
    run_id: str,
    progress: Progress,
    watch: Stopwatch,
) -> bool:
    """Build and play whatever is missing, and write it up; False where nothing was missing."""
    plan = make_plan(spec)
    store = Store(settings.store)
    with closing(directory.ledger()) as ledger:
        with progress.step("checking what is there"):
            present = verified_artifacts(plan, store, ledger, progress)
        if directory.played and present >= plan.needed:
            if directory.finished:
                return False
        else:
            directory.mark(finished=False)
            facts: Plain = {"run_id": run_id}
            directory.write_json(PROVENANCE, provenance() | facts)
            facts |= _work(plan, settings, directory, store, ledger, present, progress, watch)
            with storage_errors(directory.path), progress.step("writing"):
                counts = write_readable(plan, store, ledger, directory)
                episodes = write_episodes(directory.path)
                counts["episodes"] = len(episodes)
                counts["environment steps without the tree"] = int(episodes["steps"].sum())
                watch.lap("writing")
                facts |= {"seconds": watch.rounded(), "counts": counts}
                directory.write_json(PROVENANCE, provenance() | facts)
    with storage_errors(directory.path), progress.step("report"):
        build_report(directory.path)
    directory.mark(finished=True)
    watch.lap("report")
    return True


def _work(
    plan: Plan,
    settings: Settings,
    directory: RunDirectory,
    store: Store,
    ledger: Ledger,
    present: set[str],
    progress: Progress,
    watch: Stopwatch,
) -> Plain:
    """Train and simulate; returns what the provenance tells of it."""
    shared = Ledger(settings.store / "blocks.sqlite")
    executor = LazyExecutor(settings)
    watch.lap("preparing")
    uri = settings.resolved_tracking_uri()
    with closing(shared), closing(executor):
        if not present >= plan.needed:
            with progress.step("starting workers"):
                executor.open()
        watch.lap("starting workers")
        growing = Growing(GrowingCurves(plan, store).entries)
        with Live(lambda ending: publish(directory, uri, "RUNNING", ending, growing)):
            builds = Builds(plan, store, ledger, executor, progress)
            busy_training = builds.run(plan.needed, present)
            watch.lap("training")
            if note := undemonstrated_note(undemonstrated_skills(plan, store)):
                progress.say(note)
            evaluation = Evaluation(plan, store, ledger, shared, executor, progress)
            evaluation.run()
            watch.lap("evaluation")
            _illustrate(builds, plan, present, progress)
            watch.lap("illustrations")
    watch.lap("stopping workers")
    return {
        "executor": settings.executor,
        "workers": executor.opened.workers if executor.opened else 0,
        "busy worker seconds": {
            "training": round(busy_training, 1),
            "evaluation": round(evaluation.seconds, 1),
        },
    }


def _illustrate(builds: Builds, plan: Plan, present: set[str], progress: Progress) -> None:
    """Last, and failing only costs a figure: it must not stand in the way of a number."""
    missing = set(plan.recipes) - plan.needed - present
    if not missing:
        return
    try:
        builds.run(missing, present | plan.needed, phase="illustrations")
    except (BadDataError, IncompleteError) as error:
        progress.say(f"figures will be missing: {error}")
