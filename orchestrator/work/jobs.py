"""What travels between driver and workers: plain descriptions, never live objects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from orchestrator.storage.ledger import Outcome
from orchestrator.storage.store import Artifact
from orchestrator.work.recipes import Recipe
from stitching.methods.protocol import MethodSettings
from stitching.rollout import RolloutConfig

ATTEMPTS = 3  # at one job, before it is given up


@dataclass(frozen=True)
class BuildJob:
    """Make one artifact; its inputs have been provided to the executor before."""

    recipe: Recipe
    checkpoints: Path | None = None  # where its trainings may leave checkpoints

    @property
    def name(self) -> str:
        return f"{self.recipe.kind} {self.recipe.key}"


@dataclass(frozen=True)
class BlockTask:
    """All a worker must know to play one block."""

    key: str
    benchmark: str
    root_seed: int
    seed: int
    method: str  # its name; SHARED for first skills that methods share
    settings: MethodSettings
    prefix: tuple[str, ...]
    episodes: tuple[int, int]  # first and one past the last, of the whole block
    step_limit: int
    rollout: RolloutConfig
    artifacts: dict[str, str]  # kind → key: the policies, and what the stitcher needs

    @property
    def name(self) -> str:
        method = f" by {self.method}" if self.method else ""
        first, last = self.episodes[0], self.episodes[1] - 1
        return f"seed {self.seed}, {'>'.join(self.prefix)}{method}, episodes {first}–{last}"


@dataclass(frozen=True)
class PlayJob:
    """A handful of blocks for one worker, each with its parent's outcome (None at the root).

    How blocks are bundled is a matter of speed alone: each is played by itself.
    """

    tasks: tuple[tuple[BlockTask, Outcome | None], ...]

    @property
    def name(self) -> str:
        return f"{len(self.tasks)} blocks from {self.tasks[0][0].name}"


Job = BuildJob | PlayJob
Trouble = Literal["failed", "bad data", "lost"]


@dataclass(frozen=True)
class BlockReport:
    """One block's outcome as bytes for the ledger, or why there is none."""

    key: str
    outcome: bytes | None
    error: str = ""
    segments: int = 0
    seconds: float = 0.0


@dataclass(frozen=True)
class Report:
    """What became of a job. `lost` means the worker died: the work itself may be innocent."""

    job: Job
    artifact: Artifact | None = None
    blocks: tuple[BlockReport, ...] = ()
    seconds: float = 0.0
    earlier_seconds: float = 0.0  # of attempts whose checkpoints a build went on from
    trouble: Trouble | None = None
    error: str = ""
