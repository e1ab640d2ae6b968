"""Ready models from what the store keeps of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from orchestrator.builders.parts import Inputs
from orchestrator.store import Artifact
from stitching.data.uncut import no_conditions
from stitching.envs.protocol import Benchmark, conditions
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.models.initiation import Initiation

Configs = Mapping[str, DynamicsConfig]  # by kind, where loading a model needs to know


def _agent(artifact: Artifact, benchmark: Benchmark, configs: Configs) -> Agent:
    return Agent(artifact.arrays, conditions(benchmark), benchmark.actions)


def _mf_policy(artifact: Artifact, benchmark: Benchmark, configs: Configs) -> Agent:
    """What the reading of its data has told it, one condition a pair of skills."""
    return Agent(artifact.arrays, artifact.arrays["conditions"], benchmark.actions)


def _single_policy(artifact: Artifact, benchmark: Benchmark, configs: Configs) -> Agent:
    return Agent(artifact.arrays, no_conditions(len(benchmark.skills)), benchmark.actions)


def _initiation_sets(artifact: Artifact, benchmark: Benchmark, configs: Configs) -> Initiation:
    return Initiation.of(artifact.arrays)


def _dynamics(artifact: Artifact, benchmark: Benchmark, configs: Configs) -> Dynamics:
    return Dynamics(artifact.arrays, configs["dynamics"])


LOADERS: dict[str, Callable[[Artifact, Benchmark, Configs], Any]] = {
    "agent": _agent,
    "mf-policy": _mf_policy,
    "single-policy": _single_policy,
    "initiation-sets": _initiation_sets,
    "dynamics": _dynamics,
}


def load_models(benchmark: Benchmark, configs: Configs, inputs: Inputs) -> Models:
    """Those of the inputs that are models: roles that are no kind of model are data."""
    trained = {
        kind: LOADERS[kind](artifact, benchmark, configs)
        for kind, artifact in inputs.items()
        if kind in LOADERS
    }
    return Models(benchmark.actions, len(benchmark.skills), trained)
