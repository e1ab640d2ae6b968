"""How each kind of artifact is made, and whose code decides what is in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.methods import make_stitcher
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.experience import mixed_conditions, mixed_experience, skill_experience
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
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
    code: tuple[str, ...]  # the modules whose code, with all they import, decides the content


def _dataset(data: Transitions) -> Artifact:
    info = {
        "format": "columns",
        "rows": len(data),
        "episodes": len(data.episode_ends),
        "successes": int(np.sum(data.episode_successes)),
    }
    return Artifact(data.columns(), info)


def _maze_demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return _dataset(skill_demonstrations(MAZE, config, params["root_seed"]))


def _maze_exploration(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return _dataset(exploration(MAZE, config, params["root_seed"]))


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


def _maze_showcase(params: Plain, inputs: Inputs) -> Artifact:
    models = load_models(MAZE, params["configs"], inputs)
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


PLANNERS = ("stitching.planning.cem", "stitching.planning.random_shooting")

BUILDERS: dict[str, Builder] = {
    "maze-demonstrations": Builder(_maze_demonstrations, ("stitching.data.maze",)),
    "maze-exploration": Builder(_maze_exploration, ("stitching.data.maze",)),
    "maze-showcase": Builder(_maze_showcase, ("stitching.showcase", *PLANNERS)),
    "agent": Builder(_agent, ("stitching.models.iql", "stitching.data.experience")),
    "mf-policy": Builder(_mf_policy, ("stitching.models.iql", "stitching.data.experience")),
    "dynamics": Builder(_dynamics, ("stitching.models.dynamics",)),
}
# What decides a block's outcome beside the models: Algorithm 1 and the planners.
BLOCK_CODE = ("stitching.rollout", *PLANNERS)
# And how work is set up, without the method's code that these import for other purposes.
SETUP_CODE = ("orchestrator.builders", "orchestrator.methods", "orchestrator.worker")


@dataclass(frozen=True)
class Kit:
    """What a benchmark brings along: its settings, its data, and perhaps a recorded figure."""

    data: type[MazeDataConfig]
    datasets: dict[str, str]  # role → kind; skills learn from "demonstrations", dynamics from all
    showcase: str | None = None  # kind
    shown_task: tuple[str, ...] = ()  # in the showcase, where the spec has it


KITS: dict[str, Kit] = {
    "maze": Kit(
        MazeDataConfig,
        {"demonstrations": "maze-demonstrations", "exploration": "maze-exploration"},
        showcase="maze-showcase",
        shown_task=("g0", "g1", "g3", "g2"),  # the paper's Figure 1
    ),
}
