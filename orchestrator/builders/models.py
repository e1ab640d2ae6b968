"""Ready models from what the store keeps of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from orchestrator.builders.parts import Inputs
from orchestrator.spec.structure import structure
from orchestrator.storage.store import Artifact
from stitching.data.uncut import no_conditions
from stitching.envs.protocol import Benchmark, conditions
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.models.initiation import Initiation


def _agent(artifact: Artifact, benchmark: Benchmark) -> Agent:
    return Agent(artifact.arrays, conditions(benchmark), benchmark.actions)


def _mf_policy(artifact: Artifact, benchmark: Benchmark) -> Agent:
    """What the reading of its data has told it, one condition a pair of skills."""
    return Agent(artifact.arrays, artifact.arrays["conditions"], benchmark.actions)


def _single_policy(artifact: Artifact, benchmark: Benchmark) -> Agent:
    return Agent(artifact.arrays, no_conditions(len(benchmark.skills)), benchmark.actions)


def _initiation_sets(artifact: Artifact, benchmark: Benchmark) -> Initiation:
    return Initiation.of(artifact.arrays)


def _dynamics(artifact: Artifact, benchmark: Benchmark) -> Dynamics:
    config = structure(DynamicsConfig, artifact.info["config"], "dynamics")
    return Dynamics(artifact.arrays, config)


LOADERS: dict[str, Callable[[Artifact, Benchmark], Any]] = {
    "agent": _agent,
    "mf-policy": _mf_policy,
    "single-policy": _single_policy,
    "initiation-sets": _initiation_sets,
    "dynamics": _dynamics,
}


def load_models(benchmark: Benchmark, inputs: Inputs) -> Models:
    """Those of the inputs that are models: roles that are no kind of model are data."""
    trained = {
        kind: LOADERS[kind](artifact, benchmark)
        for kind, artifact in inputs.items()
        if kind in LOADERS
    }
    return Models(benchmark.actions, len(benchmark.skills), trained)
