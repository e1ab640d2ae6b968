"""Where jobs run. Executors differ in speed, never in results."""

from __future__ import annotations

from typing import Protocol

from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import Job, Report


class Executor(Protocol):
    """Takes jobs, gives back one report each, in the order in which they finish.

    Reports never carry half a job: a worker that dies yields a report whose trouble is "lost".
    """

    @property
    def workers(self) -> int:
        """How many jobs can run at once."""
        ...

    def provide(self, key: str, artifact: Artifact) -> None:
        """Make an artifact available to all jobs submitted from now on."""

    def submit(self, job: Job) -> None:
        """Queue a job; every artifact it names has been provided."""

    def next(self) -> Report:
        """Wait for one job to finish. To be called once for each submitted job."""
        ...

    def close(self) -> None:
        """Stop all workers; jobs in flight are dropped."""
