"""Artifacts: what is in the store and whole, and making what is missing."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from orchestrator.builders.registry import BUILDERS
from orchestrator.errors import BadDataError, ChangedError, IncompleteError
from orchestrator.executors.protocol import Executor
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.store import CorruptArtifactError, Store
from orchestrator.work.jobs import ATTEMPTS, BuildJob, Report
from orchestrator.work.plan import Plan
from orchestrator.work.progress import Progress
from orchestrator.work.recipes import Recipe
from orchestrator.work.trainings import Trainings
from orchestrator.work.worker import build


def verified_artifacts(plan: Plan, store: Store, ledger: Ledger, progress: Progress) -> set[str]:
    """Keys of the plan's artifacts that are in the store and whole.

    A damaged one is named, set aside and counts as missing. Raises ChangedError when a whole one
    is not the one that this run's blocks were played with.
    """
    whole = set()
    for key, recipe in plan.recipes.items():
        if (recipe.kind, key) not in store:
            continue
        try:
            digest = store.read(recipe.kind, key).digest
        except CorruptArtifactError as error:
            aside = store.discard(recipe.kind, key)
            progress.say(f"damaged artifact, will be rebuilt: {error} (set aside as {aside})")
            continue
        _check_artifact(ledger, recipe, digest)
        whole.add(key)
    return whole


def _check_artifact(ledger: Ledger, recipe: Recipe, digest: str) -> None:
    recorded = ledger.record_artifact(recipe.key, digest)
    if recorded != digest:
        raise ChangedError(
            f"{recipe.kind} {recipe.key} now has other bytes ({digest[:12]}) than when this run "
            f"began ({recorded[:12]}): it was rebuilt on another kind of machine. Choose another "
            "--out to start over with it"
        )


@dataclass
class Builds:
    """Makes missing artifacts, each as soon as its inputs are there."""

    plan: Plan
    store: Store
    ledger: Ledger
    executor: Executor
    progress: Progress
    _attempts: dict[str, int] = field(default_factory=dict)

    def run(self, wanted: set[str], present: set[str], phase: str = "training") -> float:
        """Build what is wanted and not present; returns the seconds that workers were busy.

        Raises BadDataError for data or training that cannot be used, IncompleteError for a build
        that failed three times.
        """
        recipes = self.plan.recipes
        missing = {key: r for key, r in recipes.items() if key in wanted - present}
        self.progress.phase(phase, len(wanted), len(wanted & present))
        available, submitted = set(present), set[str]()
        trainings = Trainings(self.store, recipes, set(missing), len(self.plan.spec.skill_names))
        with self.progress.watching(
            lambda: trainings.under_way(available & submitted, submitted - available)
        ):
            for key in self._inputs_of(missing.values()) & present:
                self._provide(recipes[key])
            return self._run(missing, available, submitted)

    def _run(self, missing: dict[str, Recipe], available: set[str], submitted: set[str]) -> float:
        """Keys of what is there and of what has been submitted change as the builds go on."""
        seconds, own = 0.0, deque[BuildJob]()  # jobs for the driver
        while not set(missing) <= available:
            for key, recipe in missing.items():
                if key not in submitted and set(recipe.inputs.values()) <= available:
                    job = BuildJob(recipe, self.store.checkpoints(key))
                    submitted.add(key)
                    if BUILDERS[recipe.kind].by_driver:
                        own.append(job)
                    else:
                        self.executor.submit(job)
            report = build(own.popleft(), {}) if own else self.executor.next()
            assert isinstance(report.job, BuildJob)
            recipe = report.job.recipe
            if self._finish(recipe, report):
                seconds += report.seconds
                available.add(recipe.key)
                self.progress.advance()
            else:
                submitted.discard(recipe.key)
        return seconds

    def _inputs_of(self, recipes: Iterable[Recipe]) -> set[str]:
        return {key for recipe in recipes for key in recipe.inputs.values()}

    def _provide(self, recipe: Recipe) -> None:
        self.executor.provide(recipe.key, self.store.read(recipe.kind, recipe.key))

    def _finish(self, recipe: Recipe, report: Report) -> bool:
        """Keep a built artifact; False when the build is to be tried again."""
        if report.artifact is not None:
            made = {
                "kind": recipe.kind,
                "params": recipe.params,
                "inputs": recipe.inputs,
                "seconds": round(report.earlier_seconds + report.seconds, 3),
            }
            digest = self.store.write(recipe.kind, recipe.key, report.artifact, made)
            self.store.drop_checkpoints(recipe.key)
            _check_artifact(self.ledger, recipe, digest)
            self.executor.provide(recipe.key, report.artifact)
            return True
        if report.trouble == "bad data":
            raise BadDataError(f"{recipe.kind} {recipe.key}: {self._located(recipe, report.error)}")
        attempts = self._attempts[recipe.key] = self._attempts.get(recipe.key, 0) + 1
        if attempts >= ATTEMPTS:
            raise IncompleteError(
                f"building {recipe.kind} {recipe.key} failed {attempts} times, last with:\n"
                f"{report.error.strip()}"
            )
        self.progress.say(f"building {recipe.kind} again: {report.error.strip().splitlines()[-1]}")
        return False

    def _located(self, recipe: Recipe, error: str) -> str:
        """Replace the role of a dataset by its place in the store."""
        for role, key in recipe.inputs.items():
            if error.startswith(f"{role}/"):
                kind = self.plan.recipes[key].kind
                return f"{self.store.path(kind, key)}{error.removeprefix(role)}"
        return error
