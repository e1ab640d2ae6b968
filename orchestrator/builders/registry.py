"""The builders by kind of artifact: of what is trained, and of every benchmark's own."""

from __future__ import annotations

from functools import reduce
from operator import or_

from orchestrator.benchmarks.registry import ENTRIES
from orchestrator.builders.parts import Builder
from orchestrator.builders.training import TRAINING_BUILDERS

BUILDERS: dict[str, Builder] = reduce(
    or_, (dict(entry.builders) for entry in ENTRIES.values()), TRAINING_BUILDERS
)

# What decides a block's outcome beside its method and its models: Algorithm 1, and what counts.
BLOCK_CODE = ("stitching.rollout", "stitching.envs.first_times")
# What sets it up, without what these import for other purposes.
BLOCK_SETUP = (
    "orchestrator.builders.models",
    "orchestrator.spec.methods",
    "orchestrator.work.playing",
)
