"""Making an artifact: the same in this process and in a Ray task."""

from __future__ import annotations

import time
import traceback

import torch

from orchestrator.builders.parts import Inputs
from orchestrator.builders.registry import BUILDERS
from orchestrator.work.checkpoints import Checkpoints
from orchestrator.work.jobs import BuildJob, Report
from stitching.data.transitions import DataError
from stitching.models.checkpoints import checkpoints_by


def use_one_thread() -> None:
    """One thread a worker: more would change the bytes, and cost more than they gain."""
    torch.set_num_threads(1)


def build(job: BuildJob, inputs: Inputs) -> Report:
    """Make an artifact; inputs by role. Trouble is reported, not raised."""
    started = time.perf_counter()
    kept = Checkpoints(job.checkpoints)
    try:
        with checkpoints_by(kept.of):
            artifact = BUILDERS[job.recipe.kind].make(job.recipe.params, inputs)
    except (DataError, FloatingPointError) as error:
        return Report(job, trouble="bad data", error=str(error))
    except Exception:
        return Report(job, trouble="failed", error=traceback.format_exc(limit=-3))
    seconds = time.perf_counter() - started
    return Report(job, artifact=artifact, seconds=seconds, earlier_seconds=kept.earlier)
