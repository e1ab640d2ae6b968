"""Ready models from what the store keeps of them."""

from __future__ import annotations

from typing import Any

from orchestrator.builders.parts import Inputs
from orchestrator.structure import Plain, structure
from stitching.data.uncut import no_conditions
from stitching.envs.protocol import Benchmark, conditions
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.reach_stitch import Initiation


def load_models(benchmark: Benchmark, configs: Plain, artifacts: Inputs) -> dict[str, Any]:
    """Ready models by kind, from their artifacts and plain training configurations."""
    models: dict[str, Any] = {}
    for kind, artifact in artifacts.items():
        if kind == "agent":
            models[kind] = Agent(artifact.arrays, conditions(benchmark), benchmark.actions)
        elif kind == "mf-policy":
            # What the reading of its data has told it, one condition a pair of skills.
            models[kind] = Agent(artifact.arrays, artifact.arrays["conditions"], benchmark.actions)
        elif kind == "single-policy":
            unconditioned = no_conditions(len(benchmark.skills))
            models[kind] = Agent(artifact.arrays, unconditioned, benchmark.actions)
        elif kind == "initiation-sets":
            models[kind] = Initiation.of(artifact.arrays)
        elif kind == "dynamics":
            config = structure(DynamicsConfig, configs[kind], kind)
            models[kind] = Dynamics(artifact.arrays, config)
    return models
