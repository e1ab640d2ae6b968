"""Where candidates are played: plans over one executor, one store and one ledger."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import pandas as pd

from analysis.episodes import episodes_from_segments
from analysis.schema import RunSpec
from orchestrator.errors import IncompleteError
from orchestrator.executors.protocol import Executor
from orchestrator.spec.spec import Spec
from orchestrator.storage.claim import describe
from orchestrator.storage.exports import quarantine, segments_frame
from orchestrator.storage.ledger import Ledger, Outcome
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.building import Builds, verified_artifacts
from orchestrator.work.evaluation import Evaluation
from orchestrator.work.jobs import BuildJob, Job, PlayJob, Report
from orchestrator.work.plan import Plan, make_plan
from orchestrator.work.progress import Progress, Silent

SHARED = "first skills, shared"
"""Segments of no one method; a first skill that is stitched to is of the method that does."""


@dataclass(frozen=True)
class PlayedSpec:
    """What a spec's episodes did: rows a segment and rows an episode (see `analysis`)."""

    segments: pd.DataFrame
    episodes: pd.DataFrame
    run: RunSpec  # what was asked, of these seeds alone


@dataclass
class CountingExecutor:
    """An executor that counts what it was asked to do, and is handed each artifact but once."""

    inner: Executor
    built: Counter[str] = field(default_factory=Counter)  # kind → artifacts
    blocks: Counter[str] = field(default_factory=Counter)  # kind of segment → blocks played
    steps: Counter[str] = field(default_factory=Counter)  # kind of segment → environment steps
    seconds: defaultdict[str, float] = field(  # kind of segment → worker seconds
        default_factory=lambda: defaultdict(float)
    )
    _provided: set[str] = field(default_factory=set)

    def counts(self) -> dict[str, dict[str, float]]:
        """Everything counted, by what is counted and its kind."""
        return {
            "artifacts trained": dict(self.built),
            "blocks played": dict(self.blocks),
            "environment steps": dict(self.steps),
            "worker seconds": {kind: round(spent, 1) for kind, spent in self.seconds.items()},
        }

    @property
    def workers(self) -> int:
        return self.inner.workers

    def provide(self, key: str, artifact: Artifact) -> None:
        if key not in self._provided:
            self.inner.provide(key, artifact)
            self._provided.add(key)

    def submit(self, job: Job) -> None:
        self.inner.submit(job)

    def next(self) -> Report:
        report = self.inner.next()
        if isinstance(report.job, BuildJob):
            self.built[report.job.recipe.kind] += report.artifact is not None
        elif isinstance(report.job, PlayJob):
            kinds = {task.key: task.method or SHARED for task, _ in report.job.tasks}
            for block in report.blocks:
                if block.outcome is not None:
                    kind = kinds[block.key]
                    steps = Outcome.from_bytes(block.outcome).arrays["steps"]
                    self.blocks[kind] += 1
                    self.steps[kind] += int(steps.sum())
                    self.seconds[kind] += block.seconds
        return report

    def close(self) -> None:
        self.inner.close()


class Quiet(Silent):
    """Passes on what is said, and draws nothing: the sweep's own bar counts trials."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress

    def say(self, message: str) -> None:
        self._progress.say(message)


class SpecPlayer:
    """Plays specs, finding whatever any run over the same store has finished."""

    def __init__(self, store: Path, ledger: Ledger, executor: Executor, progress: Progress) -> None:
        self.store = Store(store)
        self.ledger = ledger
        self.shared = Ledger(store / "blocks.sqlite")
        self.executor = CountingExecutor(executor)
        self.progress = progress
        self._whole: set[str] = set()  # artifacts that are there, each checked but once

    @contextmanager
    def quietly(self) -> Iterator[None]:
        """Inside, only what is said gets through: the sweep's own bar shows how far it is."""
        loud, self.progress = self.progress, Quiet(self.progress)
        try:
            yield
        finally:
            self.progress = loud

    def prepare(self, specs: Iterable[Spec], seeds: Iterable[int] | None = None) -> None:
        """Train what some specs need and the store does not have, side by side."""
        self._build([only_seeds(make_plan(spec), _seeds(spec, seeds)) for spec in specs])

    def play(self, spec: Spec, seeds: Iterable[int] | None = None) -> PlayedSpec:
        """Train and simulate what is missing; all seeds of the spec, or some.

        Raises IncompleteError when blocks had to be given up: a result on what is left would be
        another one. The same command tries again.
        """
        wanted = _seeds(spec, seeds)
        plan = only_seeds(make_plan(spec), wanted)
        self._build([plan])
        Evaluation(plan, self.store, self.ledger, self.shared, self.executor, self.progress).run()
        if given_up := quarantine(plan, self.ledger):
            raise IncompleteError(
                f"{len(given_up)} blocks were given up after repeated failures, last with: "
                f"{given_up[-1]['error'].strip()}\nThe same command tries again"
            )
        segments = segments_frame(plan, self.ledger)
        run = replace(RunSpec.from_dict(describe(spec)), seeds=wanted)
        return PlayedSpec(segments, episodes_from_segments(segments, run), run)

    def _build(self, plans: Sequence[Plan]) -> None:
        if not plans:
            return
        needed = {key for plan in plans for key in plan.needed}
        recipes = {key: recipe for plan in plans for key, recipe in plan.recipes.items()}
        # Whoever builds and verifies looks at a plan's recipes alone.
        unseen = replace(
            plans[0], recipes={k: r for k, r in recipes.items() if k in needed - self._whole}
        )
        self._whole |= verified_artifacts(unseen, self.store, self.ledger, self.progress)
        if needed - self._whole:
            plan = replace(plans[0], recipes=recipes)
            builds = Builds(plan, self.store, self.ledger, self.executor, self.progress)
            builds.run(needed, self._whole & set(recipes))
            self._whole |= needed

    def close(self) -> None:
        self.executor.close()
        self.shared.close()


def _seeds(spec: Spec, seeds: Iterable[int] | None) -> tuple[int, ...]:
    """All of a spec's, or those that are wanted."""
    return tuple(range(spec.seeds) if seeds is None else seeds)


def only_seeds(plan: Plan, seeds: tuple[int, ...]) -> Plan:
    """The part of a plan that some seeds take."""
    return replace(
        plan,
        models={place: key for place, key in plan.models.items() if place[1] in seeds},
        nodes=tuple(node for node in plan.nodes if node.seed in seeds),
    )
