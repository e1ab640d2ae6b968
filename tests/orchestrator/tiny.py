"""What the orchestrator's tests share: a tiny reproduction, and its promised bytes."""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.builders.models import load_models
from orchestrator.executors.serial import SerialExecutor
from orchestrator.reproduction import Settings, reproduce
from orchestrator.spec.methods import (
    first_method,
    method_env,
    method_name,
    method_of,
    method_rollout,
)
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.storage.ledger import Ledger, Outcome
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Store
from orchestrator.work.jobs import BuildJob, Job
from orchestrator.work.plan import Node, Plan
from orchestrator.work.progress import Silent
from stitching.models.agent import Agent
from stitching.rollout import Block, Segments, play_from_start

TINY = Path(__file__).with_name("tiny.toml")


def tiny_spec() -> Spec:
    return load_spec(str(TINY))


class Lines(Silent):
    """Keeps what a person would have been told."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.phases: dict[str, tuple[int, int]] = {}  # name → total, already done

    def phase(self, name: str, total: int, done: int) -> None:
        self.phases[name] = total, done

    def say(self, message: str) -> None:
        self.lines.append(message)

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


def carry_out(spec: Spec, settings: Settings, progress: Silent | None = None) -> RunDirectory:
    """A whole reproduction; without figures, which would be most of its time."""
    with mock.patch("analysis.report.draw_figures", return_value=[]):
        return reproduce(spec, settings, progress or Silent())


def serially(out: Path, store: Path) -> Settings:
    return Settings(out, store, executor="serial", tracking_uri="none")


def promised_bytes(run: Path) -> dict[str, bytes]:
    """The files that must not depend on how a run was carried out: episodes and every table."""
    tables = [path for path in (run / "report").iterdir() if path.suffix in (".csv", ".md", ".tex")]
    assert len(tables) >= 4
    files = [run / "episodes.parquet", run / "segments.parquet", *tables]
    return {str(file.relative_to(run)): file.read_bytes() for file in files}


def blocks_played(out: Path) -> int:
    """By a run under way in another process, which may not even have begun."""
    if not (out / "ledger.sqlite").is_file():
        return 0
    with closing(sqlite3.connect(out / "ledger.sqlite", timeout=30)) as db:
        try:
            (count,) = db.execute("SELECT COUNT(*) FROM blocks").fetchone()
        except sqlite3.OperationalError:  # the file is there, its tables are not yet
            return 0
    return int(count)


@dataclass(frozen=True)
class Place:
    """A run directory and the store beside it."""

    root: Path

    @property
    def out(self) -> Path:
        return self.root / "run"

    @property
    def store_root(self) -> Path:
        return self.root / "store"

    @property
    def store(self) -> Store:
        return Store(self.store_root)

    @property
    def directory(self) -> RunDirectory:
        return RunDirectory(self.out)

    def shared(self) -> Ledger:
        return Ledger(self.store_root / "blocks.sqlite")

    def finished_blocks(self) -> set[str]:
        ledger = self.directory.ledger(read_only=True)
        try:
            return ledger.finished()
        finally:
            ledger.close()

    def copied(self, root: Path) -> Place:
        """Everything, elsewhere."""
        shutil.copytree(self.root, root)
        return Place(root)

    def trained(self, root: Path) -> Place:
        """Elsewhere, with all artifacts, and nothing played."""
        unplayed = shutil.ignore_patterns("blocks.sqlite*")
        shutil.copytree(self.store_root, root / "store", ignore=unplayed)
        return Place(root)

    def carry_out(self, spec: Spec, progress: Silent | None = None) -> RunDirectory:
        return carry_out(spec, serially(self.out, self.store_root), progress)


class Counted(SerialExecutor):
    """Remembers what it was asked to do."""

    def __init__(self) -> None:
        super().__init__()
        self.built: Counter[str] = Counter()
        self.played: Counter[str] = Counter()

    def submit(self, job: Job) -> None:
        if isinstance(job, BuildJob):
            self.built[job.recipe.key] += 1
        else:
            self.played.update(task.key for task, _ in job.tasks)
        super().submit(job)


@dataclass(frozen=True)
class Alone:
    """A task of one seed and method, to be played from its start by a fixed group of episodes."""

    plan: Plan
    place: Place
    seed: int
    method: str
    task: tuple[str, ...]
    chunk: int

    def play(self, step_limit: int) -> list[Segments]:
        spec = self.plan.spec
        benchmark = BENCHMARKS[spec.benchmark]
        task = self.plan.tasks[Node(self.seed, self.method, self.task), self.chunk]
        artifacts = {kind: self.place.store.read(kind, key) for kind, key in task.artifacts.items()}
        models = load_models(benchmark, artifacts)
        method = method_of(self.method)
        agent = models.one(method.policy, Agent)
        return play_from_start(
            method_env(self.method, benchmark),
            agent,
            method.stitcher(spec.method_settings(self.method), models),
            benchmark,
            method_rollout(self.method, spec.rollout),
            Block(
                spec.root_seed,
                spec.benchmark,
                self.seed,
                method_name(self.method),
                tuple(range(*self.plan.chunks[self.chunk])),
                self.task,
            ),
            step_limit,
        )

    def recorded(self) -> list[Outcome]:
        """What the tree has for the same, one outcome a skill while any episode survives."""
        nodes = [
            Node(
                self.seed,
                self.method if depth > 1 else first_method(self.method, self.plan.spec.rollout),
                self.task[:depth],
            )
            for depth in range(1, len(self.task) + 1)
        ]
        ledger = self.place.directory.ledger(read_only=True)
        keys = [self.plan.tasks[node, self.chunk].key for node in nodes]
        outcomes = [outcome for _, outcome in ledger.outcomes(keys)]
        ledger.close()
        return outcomes

    def depth_of_the_same_bytes(self) -> int:
        """Skills played, each with the bytes that the tree has for it."""
        recorded, played = self.recorded(), self.play(self.plan.spec.step_limit)
        assert len(played) == len(recorded)
        for segments, outcome in zip(played, recorded, strict=True):
            for name in ("success", "stitch_steps", "steps", "value_start", "value_end"):
                ours, theirs = outcome.arrays[name], getattr(segments, name)
                assert ours.dtype == theirs.dtype
                assert ours.tobytes() == theirs.tobytes(), (self.task, name)
            reached = segments.snapshots[segments.success]
            assert outcome.arrays["snapshots"].tobytes() == reached.tobytes()
        return len(played)
