"""An episode of a run's ledger, played again step by step: for films and for a closer look."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch
from threadpoolctl import threadpool_limits

from analysis.schema import PROVENANCE, SEPARATOR
from orchestrator.benchmarks.registry import BENCHMARKS, ENTRIES
from orchestrator.builders.models import LOADERS
from orchestrator.errors import ChangedError, NondeterminismError, UsageError
from orchestrator.spec.methods import method_of
from orchestrator.spec.structure import Plain
from orchestrator.storage import locking
from orchestrator.storage.claim import spec_of
from orchestrator.storage.ledger import Ledger, Outcome
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Artifact, Store
from orchestrator.work.jobs import BlockTask
from orchestrator.work.plan import Node, Plan, make_plan
from orchestrator.work.playing import BlockPlayer
from stitching.studies.showcase.recorder import EpisodeRecorder


@dataclass(frozen=True)
class Asked:
    """Which episode: one number of a task's, by a method with the models of a seed."""

    task: tuple[str, ...]
    method: str
    seed: int = 0
    episode: int | None = None  # default: the first that accomplishes most


def replay(directory: RunDirectory, asked: Asked, store_root: Path | None = None) -> Plain:
    """The episode as a showcase with one episode: see `stitching.studies.showcase`.

    The whole blocks that it belongs to are played, as they were, and compared with the ledger.

    Raises UsageError where the run has no such episode or has not played it, where other code did,
    or where a model is not in the store; ChangedError where a model there is another one;
    NondeterminismError where the same block does something else than on record.
    """
    return Replay(directory, asked, Store(store_root or directory.store_root)).showcase()


class Replay:
    """One episode of a run, and what it takes to play it again."""

    def __init__(self, directory: RunDirectory, asked: Asked, store: Store) -> None:
        self.directory, self.asked, self.store = directory, asked, store
        self.plan: Plan = make_plan(spec_of(directory))
        self.path = self._path()

    def showcase(self) -> Plain:
        if not self.store.root.is_dir():
            raise UsageError(f"there is no store at {self.store.root}; name it with --store")
        ledger = self.directory.ledger(read_only=True)
        try:
            with locking.shared(self.store.root, _say_nothing), _one_thread():
                return self._played_again(ledger)
        finally:
            ledger.close()

    def _path(self) -> list[Node]:
        """The nodes from the task's first skill to its last. UsageError where the run has none."""
        spec, asked, where = self.plan.spec, self.asked, self.directory.path
        if asked.task not in spec.all_tasks:
            task, tasks = SEPARATOR.join(asked.task), _some(spec.all_tasks)
            raise UsageError(f"{where} has no task {task!r}; it has {tasks}")
        if asked.method not in spec.methods:
            known = ", ".join(spec.methods)
            raise UsageError(f"{where} has no method {asked.method!r}; it has {known}")
        for name, number, count in (
            ("seed", asked.seed, spec.seeds),
            ("episode", asked.episode or 0, spec.episodes),
        ):
            if not 0 <= number < count:
                raise UsageError(f"{where} has no {name} {number}; they go from 0 to {count - 1}")
        # A first skill may be shared: then no node of this prefix has the method's name.
        players = (asked.method, self.plan.first_method(asked.method))
        node: Node | None = next(
            node
            for node in reversed(self.plan.nodes)
            if (node.seed, node.prefix) == (asked.seed, asked.task) and node.method in players
        )
        path: list[Node] = []
        while node is not None:
            path.insert(0, node)
            node = node.parent
        return path

    def _played_again(self, ledger: Ledger) -> Plain:
        number = self.asked.episode
        if number is None:
            number = self._most_accomplished(ledger)
        chunk = next(c for c, (first, end) in enumerate(self.plan.chunks) if first <= number < end)
        tasks = [self.plan.task(node, chunk) for node in self.path]
        artifacts = self._artifacts(ledger, tasks)
        player, recorder = BlockPlayer(), self._recorder(tasks[-1], artifacts)
        segment: list[int] = []  # which of the task's skills each step belongs to
        parent, accomplished = None, 0
        for place, task in enumerate(tasks):
            known = self._on_record(ledger, task)
            outcome = player.outcome(task, parent, artifacts, recorder)
            if outcome.to_bytes() != known.to_bytes():
                raise NondeterminismError(
                    f"{task.name} does something else here than on record: it was played on "
                    f"{self._cpu()}; another kind of CPU rounds otherwise"
                )
            (row,) = (outcome.arrays["episode"] == number).nonzero()[0]
            segment += [place] * int(outcome.arrays["steps"][row])
            if not outcome.arrays["success"][row]:
                break
            parent, accomplished = outcome, accomplished + 1
        name = SEPARATOR.join(self.asked.task)
        facts: Plain = {"method": self.asked.method, "task": name, "accomplished": accomplished}
        episode = facts | {"segment": segment} | recorder.episode(number)
        return recorder.scene() | {"task": name, "episode": number, "episodes": [episode]}

    def _most_accomplished(self, ledger: Ledger) -> int:
        """The first of the episodes that accomplish most of the task's skills."""
        accomplished: dict[int, int] = {}
        for node in self.path:
            for chunk, _ in enumerate(self.plan.chunks):
                for _, outcome in ledger.outcomes([self.plan.task(node, chunk).key]):
                    numbers, success = outcome.arrays["episode"], outcome.arrays["success"]
                    for number, succeeded in zip(numbers.tolist(), success.tolist(), strict=True):
                        accomplished[number] = accomplished.get(number, 0) + succeeded
        return max(sorted(accomplished), key=accomplished.__getitem__, default=0)

    def _on_record(self, ledger: Ledger, task: BlockTask) -> Outcome:
        for _, outcome in ledger.outcomes([task.key]):
            return outcome
        raise UsageError(
            f"{self.directory.path}: {task.name} is not on record: the run has not come to it "
            "(`skillstitch status` says how far it is), or other code played it (its report says "
            "which revision)"
        )

    def _artifacts(self, ledger: Ledger, tasks: Sequence[BlockTask]) -> dict[str, Artifact]:
        """The models by key, each the one that the run was played with."""
        digests, found = ledger.artifacts(), {}
        for key in {key for task in tasks for key in task.artifacts.values()}:
            kind = self.plan.recipes[key].kind
            found[key] = self.store.demand(kind, key)
            if digests.get(key, found[key].digest) != found[key].digest:
                raise ChangedError(
                    f"{kind} {key} in {self.store.root} has other bytes than the one that "
                    f"{self.directory.path} was played with: it was made on another kind of machine"
                )
        return found

    def _recorder(self, task: BlockTask, artifacts: dict[str, Artifact]) -> EpisodeRecorder:
        make = ENTRIES[task.benchmark].recorder
        if make is None:
            raise UsageError(f"{task.benchmark} has no recorder: its BenchmarkEntry can name one")
        kind = method_of(task.method).policy
        return make(LOADERS[kind](artifacts[task.artifacts[kind]], BENCHMARKS[task.benchmark]))

    def _cpu(self) -> str:
        provenance = self.directory.read_json(PROVENANCE) or {}
        return str(provenance.get("cpu", "an unknown machine"))


@contextmanager
def _one_thread() -> Iterator[None]:
    """As workers compute: more threads would round otherwise."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        torch.set_num_threads(before)


def _say_nothing(message: str) -> None:
    """Of a store that is being cleaned, which one waits for."""


def _some(tasks: Sequence[tuple[str, ...]]) -> str:
    names = [SEPARATOR.join(task) for task in tasks[:3]]
    return ", ".join(names) + (f" and {len(tasks) - 3} more" if len(tasks) > 3 else "")
