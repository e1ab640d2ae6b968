"""Playing the rollout tree: a block at a time, each once its parent's survivors are known."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from orchestrator.costs.expectations import Expectations
from orchestrator.executors.protocol import Executor
from orchestrator.storage.ledger import Ledger, Outcome, PlayCounts
from orchestrator.storage.store import Store
from orchestrator.work.jobs import ATTEMPTS, BlockReport, BlockTask, PlayJob, Report
from orchestrator.work.plan import Node, Plan
from orchestrator.work.progress import Progress, UnderWay

# Blocks sent to a worker at once: few enough that little is lost with it, enough to keep it busy.
LARGEST_BUNDLE = 64
BUNDLE_SECONDS = 5.0


@dataclass
class Evaluation:
    """Walks the rollout tree: a block is played once its parent's survivors are known."""

    plan: Plan
    store: Store
    ledger: Ledger
    shared: Ledger  # every block that any run over this store has finished
    executor: Executor
    progress: Progress
    seconds: float = 0.0  # that workers were busy playing
    _ready: deque[tuple[Node, int]] = field(default_factory=deque)
    _in_flight: int = 0
    _attempts: dict[str, int] = field(default_factory=dict)  # failed ones, of this command
    _given_up: set[str] = field(default_factory=set)
    _alone: set[str] = field(default_factory=set)  # blocks whose worker died: to be sent singly

    def run(self) -> None:
        """Play everything that is missing; blocks that fail three times are left out."""
        self.progress.phase("evaluation", len(self.plan.tasks), 0)
        with self.progress.watching(
            lambda: UnderWay(f"{self._in_flight} groups of blocks under way")
        ):
            self._begin()
            while self._ready or self._in_flight:
                self._dispatch()
                self._receive(self.executor.next())

    def _begin(self) -> None:
        """Queue what can be played at once: first skills, or what follows from finished ones."""
        self._place = {task.key: place for place, task in self.plan.tasks.items()}
        self._adopt()
        self._expected = Expectations(self.plan, self.shared.history())
        for root in self.plan.roots():
            for chunk in range(len(self.plan.chunks)):
                self._expand(root, chunk)
        if self._ready:
            self._provide_models()

    def _adopt(self) -> None:
        """Take over blocks that an earlier run over this store has finished."""
        finished = self.ledger.finished()
        missing = [key for key in self._place if key not in finished]
        self.ledger.record(self.shared.raw(missing))
        self._finished = self.ledger.finished()

    def _provide_models(self) -> None:
        keys = {key for task in self.plan.tasks.values() for key in task.artifacts.values()}
        for key in sorted(keys):
            kind = self.plan.recipes[key].kind
            self.executor.provide(key, self.store.read(kind, key))

    def _expand(self, node: Node, chunk: int) -> None:
        """Queue a block, or, where it is finished, what follows from it."""
        waiting = [node]
        while waiting:
            node = waiting.pop()
            key = self.plan.tasks[node, chunk].key
            if key in self._finished:
                self.progress.advance()
                if self._outcome(key).survivors:
                    waiting.extend(self.plan.children.get(node, []))
                else:
                    self.progress.advance(self._descendants(node))
            elif key in self._given_up:
                self.progress.advance(1 + self._descendants(node))
            else:
                self._ready.append((node, chunk))

    def _descendants(self, node: Node) -> int:
        """Blocks below a node of one chunk: decided without being played."""
        children = self.plan.children.get(node, [])
        return sum(1 + self._descendants(child) for child in children)

    def _outcome(self, key: str) -> Outcome:
        return next(outcome for _, outcome in self.ledger.outcomes([key]))

    def _dispatch(self) -> None:
        """Keep every worker supplied with about two bundles."""
        wanted = 2 * self.executor.workers
        while self._ready and self._in_flight < wanted:
            size = max(1, min(LARGEST_BUNDLE, len(self._ready) // wanted))
            bundle = [self._with_parent(*self._ready.popleft())]
            seconds = self._expected_seconds(*bundle[0])
            while (
                bundle[0][0].key not in self._alone
                and len(bundle) < size
                and seconds < BUNDLE_SECONDS
                and self._next_key() not in self._alone
            ):
                bundle.append(self._with_parent(*self._ready.popleft()))
                seconds += self._expected_seconds(*bundle[-1])
            self.executor.submit(PlayJob(tuple(bundle)))
            self._in_flight += 1

    def _expected_seconds(self, task: BlockTask, parent: Outcome | None) -> float:
        first, end = task.episodes
        segments = end - first if parent is None else parent.survivors
        return segments * self._expected.seconds_each(*self._place[task.key])

    def _next_key(self) -> str:
        return self.plan.tasks[self._ready[0]].key

    def _with_parent(self, node: Node, chunk: int) -> tuple[BlockTask, Outcome | None]:
        task = self.plan.tasks[node, chunk]
        if node.parent is None:
            return task, None
        return task, self._outcome(self.plan.tasks[node.parent, chunk].key)

    def _receive(self, report: Report) -> None:
        self._in_flight -= 1
        self.seconds += report.seconds
        assert isinstance(report.job, PlayJob)
        if report.trouble is not None:
            self._alone |= {task.key for task, _ in report.job.tasks}
            for task, _ in report.job.tasks:
                self._failed(task.key, report.error, single=len(report.job.tasks) == 1)
            return
        done = [(block.key, block.outcome) for block in report.blocks if block.outcome is not None]
        self.ledger.record(done)
        self.shared.record(done)
        self._finished |= {key for key, _ in done}
        self._remember(report.job, report.blocks)
        for block in report.blocks:
            if block.outcome is None:
                self._failed(block.key, block.error, single=True)
            else:
                self._expand(*self._place[block.key])

    def _remember(self, job: PlayJob, reports: Iterable[BlockReport]) -> None:
        kinds = {task.key: self._expected.kind(*self._place[task.key]) for task, _ in job.tasks}
        sums: dict[str, PlayCounts] = {}
        for block in reports:
            if block.outcome is not None:
                successes = Outcome.from_bytes(block.outcome).survivors
                played = PlayCounts(block.segments, successes, block.seconds)
                kind = kinds[block.key]
                sums[kind] = sums[kind] + played if kind in sums else played
        for kind, played in sums.items():
            self.shared.add_played(kind, played)
            self._expected.remember(kind, played)

    def _failed(self, key: str, error: str, *, single: bool) -> None:
        """Count a failure and queue the block again, or give it up after three attempts.

        The next command tries again what this one gave up.

        When a worker dies with several blocks, any of them may be innocent: they are then sent
        one by one, and only deaths alone count.
        """
        node, chunk = self._place[key]
        if single:
            self.ledger.record_failure(key, error)
            self._attempts[key] = self._attempts.get(key, 0) + 1
        if self._attempts.get(key, 0) >= ATTEMPTS:
            self._given_up.add(key)
            name = self.plan.tasks[node, chunk].name
            self.progress.say(f"given up after {ATTEMPTS} attempts: {name}: {error.strip()}")
            self.progress.advance(1 + self._descendants(node))
        else:
            self._ready.append((node, chunk))
