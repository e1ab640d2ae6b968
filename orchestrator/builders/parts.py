"""What builders of several benchmarks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.spec.structure import Plain
from orchestrator.storage.store import Artifact
from stitching.data.transitions import Transitions

Inputs = Mapping[str, Artifact]  # by role


@dataclass(frozen=True)
class Builder:
    """A pure function from parameters and inputs to an artifact."""

    make: Callable[[Plain, Inputs], Artifact]
    code: tuple[str, ...]  # the modules whose code, with all they import, decides the content
    setup: tuple[str, ...]  # those that set it up, without what they import for other purposes
    by_driver: bool = False  # it reads what only the machine of the command surely has


def as_artifact(data: Transitions) -> Artifact:
    """A dataset as the store keeps it."""
    info = {
        "format": "columns",
        "rows": len(data),
        "episodes": len(data.episode_ends),
        "successes": int(np.sum(data.episode_successes)),
    }
    return Artifact(data.columns(), info)
