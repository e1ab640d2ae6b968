"""Everything in this process, one job at a time: for tests, debugging and small runs."""

from __future__ import annotations

from collections import deque

from threadpoolctl import threadpool_limits

from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import BuildJob, Job, Report
from orchestrator.work.playing import BlockPlayer
from orchestrator.work.worker import build, use_one_thread


class SerialExecutor:
    """Everything in this process, one job after the other."""

    workers = 1

    def __init__(self) -> None:
        use_one_thread()
        # Numpy's linear algebra has threads of its own, which wait for each other in busy loops.
        threadpool_limits(1)
        self._player = BlockPlayer()
        self._artifacts: dict[str, Artifact] = {}
        self._jobs: deque[Job] = deque()

    def provide(self, key: str, artifact: Artifact) -> None:
        self._artifacts[key] = artifact

    def submit(self, job: Job) -> None:
        self._jobs.append(job)

    def next(self) -> Report:
        job = self._jobs.popleft()
        if isinstance(job, BuildJob):
            return build(job, {r: self._artifacts[key] for r, key in job.recipe.inputs.items()})
        return self._player.play(job, self._artifacts)

    def close(self) -> None:
        self._jobs.clear()
