"""Playing blocks: the same in this process and in a Ray actor."""

from __future__ import annotations

import time
import traceback
from collections.abc import Mapping
from typing import Any

import numpy as np

from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.builders.models import LOADERS
from orchestrator.spec.methods import method_env, method_of
from orchestrator.storage.ledger import Outcome
from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import BlockReport, BlockTask, PlayJob, Report
from stitching.envs.protocol import VectorEnv
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from stitching.rollout import Block, Recorder, begin, play_segment


class BlockPlayer:
    """Plays blocks; keeps loaded models and environments between them, and nothing else."""

    def __init__(self) -> None:
        self._loaded: dict[tuple[str, str], Any] = {}
        self._envs: dict[tuple[str, str], VectorEnv] = {}

    def play(self, job: PlayJob, artifacts: Mapping[str, Artifact]) -> Report:
        """Every block of the job; one that fails does not touch the others. Artifacts by key."""
        started = time.perf_counter()
        reports = []
        for task, parent in job.tasks:
            began = time.perf_counter()
            try:
                outcome = self.outcome(task, parent, artifacts)
                segments, seconds = len(outcome.arrays["episode"]), time.perf_counter() - began
                reports.append(BlockReport(task.key, outcome.to_bytes(), "", segments, seconds))
            except Exception:
                reports.append(BlockReport(task.key, None, traceback.format_exc(limit=-3)))
        return Report(job, blocks=tuple(reports), seconds=time.perf_counter() - started)

    def outcome(
        self,
        task: BlockTask,
        parent: Outcome | None,
        artifacts: Mapping[str, Artifact],
        recorder: Recorder | None = None,
    ) -> Outcome:
        """What one block's episodes do; a recorder changes nothing. Artifacts by key."""
        benchmark = BENCHMARKS[task.benchmark]
        method = method_of(task.method)
        trained = {kind: self._model(task, kind, artifacts) for kind in task.artifacts}
        models = Models(benchmark.actions, len(benchmark.skills), trained)
        agent = models.one(method.policy, Agent)
        stitcher = method.stitcher(task.settings, models)
        episodes, used, snapshots = survivors(task, parent)
        block = Block(
            task.root_seed, task.benchmark, task.seed, task.method, tuple(episodes), task.prefix
        )
        env = self._env(task)
        begin(env, block, snapshots)
        segments = play_segment(
            env, agent, stitcher, benchmark, task.rollout, block, task.step_limit - used, recorder
        )
        return Outcome(
            {
                "episode": np.array(episodes, dtype=np.int64),
                "success": segments.success,
                "stitch_steps": segments.stitch_steps,
                "steps": segments.steps,
                "end_step": used + segments.steps,
                "value_start": segments.value_start,
                "value_end": segments.value_end,
                "snapshots": segments.snapshots[segments.success],
            }
        )

    def _env(self, task: BlockTask) -> VectorEnv:
        place = task.benchmark, method_of(task.method).policy
        if place not in self._envs:
            self._envs[place] = method_env(task.method, BENCHMARKS[task.benchmark])
        return self._envs[place]

    def _model(self, task: BlockTask, kind: str, artifacts: Mapping[str, Artifact]) -> Any:
        key = task.artifacts[kind]
        if (kind, key) not in self._loaded:
            benchmark = BENCHMARKS[task.benchmark]
            self._loaded[kind, key] = LOADERS[kind](artifacts[key], benchmark)
        return self._loaded[kind, key]


def survivors(
    task: BlockTask, parent: Outcome | None
) -> tuple[list[int], np.ndarray, np.ndarray | None]:
    """Who plays a block: episodes, steps they have used (n,), and snapshots to go on from."""
    if parent is None:
        episodes = list(range(*task.episodes))
        return episodes, np.zeros(len(episodes), dtype=np.int64), None
    succeeded = parent.arrays["success"]
    episodes = [int(episode) for episode in parent.arrays["episode"][succeeded]]
    return episodes, parent.arrays["end_step"][succeeded], parent.arrays["snapshots"]
