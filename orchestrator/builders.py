"""How each kind of artifact is made, and whose code decides what is in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.methods import make_stitcher
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data import maze as maze_data
from stitching.data.experience import mixed_conditions, mixed_experience, skill_experience
from stitching.data.transitions import Transitions, check, concatenate
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark, conditions
from stitching.envs.registry import BENCHMARKS
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql
from stitching.models.training import Trained
from stitching.rollout import RolloutConfig
from stitching.showcase import maze_showcase

Inputs = Mapping[str, Artifact]  # by role


@dataclass(frozen=True)
class Builder:
    """A pure function from parameters and inputs to an artifact."""

    make: Callable[[Plain, Inputs], Artifact]
    code: str  # the module whose code, with all it imports, decides the content


def _dataset(data: Transitions) -> Artifact:
    info = {
        "format": "columns",
        "rows": len(data),
        "episodes": len(data.episode_ends),
        "successes": int(np.sum(data.episode_successes)),
    }
    return Artifact(data.columns(), info)


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(maze_data.MazeDataConfig, params["config"], "data")
    return _dataset(maze_data.skill_demonstrations(MAZE, config, params["root_seed"]))


def _exploration(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(maze_data.MazeDataConfig, params["config"], "data")
    return _dataset(maze_data.exploration(MAZE, config, params["root_seed"]))


def _checked_data(params: Plain, inputs: Inputs) -> tuple[Benchmark, Transitions]:
    """The union of the input datasets, each checked before anything is trained on it."""
    benchmark = BENCHMARKS[params["benchmark"]]
    parts = []
    for role, artifact in sorted(inputs.items()):
        part = Transitions(**artifact.arrays)
        check(part, benchmark, source=role)
        parts.append(part)
    return benchmark, concatenate(parts)


def _trained(trained: Trained) -> Artifact:
    return Artifact(trained.weights, {"curves": trained.curves})


def _labels(kind: str, params: Plain) -> tuple[str | int, ...]:
    return kind, params["benchmark"], params["root_seed"], params["seed"]


def _agent(params: Plain, inputs: Inputs) -> Artifact:
    benchmark, data = _checked_data(params, inputs)
    config = structure(IQLConfig, params["config"], "agent")
    experience = skill_experience(data, conditions(benchmark))
    return _trained(train_iql(experience, benchmark.actions, config, *_labels("agent", params)))


def _mf_policy(params: Plain, inputs: Inputs) -> Artifact:
    benchmark, data = _checked_data(params, inputs)
    config = structure(IQLConfig, params["config"], "mf_stitch.training")
    experience = mixed_experience(data, conditions(benchmark))
    return _trained(train_iql(experience, benchmark.actions, config, *_labels("mf-policy", params)))


def _dynamics(params: Plain, inputs: Inputs) -> Artifact:
    _, data = _checked_data(params, inputs)
    config = structure(DynamicsConfig, params["config"], "dynamics")
    return _trained(train_dynamics(data, config, *_labels("dynamics", params)))


def _showcase(params: Plain, inputs: Inputs) -> Artifact:
    models = load_models(BENCHMARKS[params["benchmark"]], params["configs"], inputs)
    stitchers = {
        method: make_stitcher(method, settings, MAZE, models["agent"], models)
        for method, settings in params["methods"].items()
    }
    scenes = maze_showcase(
        MAZE,
        Transitions(**inputs["demonstrations"].arrays),
        models["agent"],
        stitchers,
        structure(RolloutConfig, params["rollout"], "rollout"),
        tuple(params["task"]),
        params["step_limit"],
        params["root_seed"],
        params["seed"],
    )
    return Artifact({}, scenes)


def load_models(benchmark: Benchmark, configs: Plain, artifacts: Inputs) -> dict[str, Any]:
    """Ready models by kind, from their artifacts and plain training configurations."""
    models: dict[str, Any] = {}
    for kind, artifact in artifacts.items():
        if kind == "agent":
            models[kind] = Agent(artifact.arrays, conditions(benchmark), benchmark.actions)
        elif kind == "mf-policy":
            pairs = mixed_conditions(conditions(benchmark))
            models[kind] = Agent(artifact.arrays, pairs, benchmark.actions)
        elif kind == "dynamics":
            config = structure(DynamicsConfig, configs[kind], kind)
            models[kind] = Dynamics(artifact.arrays, config)
    return models


BUILDERS: dict[str, Builder] = {
    "demonstrations": Builder(_demonstrations, code="stitching.data.maze"),
    "exploration": Builder(_exploration, code="stitching.data.maze"),
    "agent": Builder(_agent, code="stitching.models.iql"),
    "mf-policy": Builder(_mf_policy, code="stitching.models.iql"),
    "dynamics": Builder(_dynamics, code="stitching.models.dynamics"),
    "showcase": Builder(_showcase, code="stitching.showcase"),
}

# What decides a block's outcome: Algorithm 1 with all it imports, and how a worker sets it up.
BLOCK_CODE = ("stitching.rollout", "orchestrator.methods", "orchestrator.worker")
