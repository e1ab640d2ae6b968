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
from stitching.data.kitchen.demonstrations import KitchenDataConfig, held_out, kept, play
from stitching.data.kitchen.human import human_demonstrations
from stitching.data.kitchen.segments import Segment, as_transitions, shown_orders
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.data.transitions import Transitions, check, concatenate
from stitching.diagnosis import competence, prediction_errors, value_progress
from stitching.envs.kitchen import GROUPS, KITCHEN
from stitching.envs.maze import MAZE
from stitching.envs.protocol import Benchmark, conditions
from stitching.envs.registry import BENCHMARKS
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql
from stitching.models.training import Trained
from stitching.rollout import RolloutConfig
from stitching.showcase.kitchen import kitchen_showcase
from stitching.showcase.maze import maze_showcase
from stitching.stitchers import Stitcher

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


def _kitchen_demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    return _cut_dataset(config, play(config, tuple(params["order"]), params["root_seed"]))


def _kitchen_human(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    return _cut_dataset(config, human_demonstrations(config.human))


def _cut_dataset(config: KitchenDataConfig, demonstrations: list[list[Segment]]) -> Artifact:
    dataset = _dataset(as_transitions(kept(config, demonstrations)))
    return Artifact(dataset.arrays, dataset.info | {"orders": shown_orders(demonstrations)})


def _kitchen_held_out(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    data, starts = held_out(config, params["root_seed"])
    dataset = _dataset(data)
    return Artifact(dataset.arrays | {"starts": starts}, dataset.info)


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


def _shown_models(params: Plain, inputs: Inputs) -> tuple[dict[str, Any], dict[str, Stitcher]]:
    """Models by kind, and the stitchers to be shown by method."""
    benchmark = BENCHMARKS[params["benchmark"]]
    models = load_models(benchmark, params["configs"], inputs)
    return models, {
        method: make_stitcher(method, settings, benchmark, models["agent"], models)
        for method, settings in params["methods"].items()
    }


def _kitchen_showcase(params: Plain, inputs: Inputs) -> Artifact:
    models, stitchers = _shown_models(params, inputs)
    scenes = kitchen_showcase(
        models["agent"],
        stitchers,
        structure(RolloutConfig, params["rollout"], "rollout"),
        tuple(params["task"]),
        params["step_limit"],
        params["root_seed"],
        params["seed"],
    )
    return Artifact({}, scenes)


def _kitchen_diagnosis(params: Plain, inputs: Inputs) -> Artifact:
    models, _ = _shown_models(params, inputs)
    agent, dynamics = models["agent"], models["dynamics"]
    columns = dict(inputs["held-out"].arrays)
    starts = columns.pop("starts")
    data = Transitions(**columns)
    rollout = structure(RolloutConfig, params["rollout"], "rollout")
    seeds = params["root_seed"], params["seed"]
    study = {
        "predictions": prediction_errors(dynamics, data, GROUPS, params["horizon"]),
        "values": value_progress(agent, KITCHEN, data),
        "competence": competence(
            agent, KITCHEN, rollout, params["step_limit"], data, starts, *seeds
        ),
    }
    return Artifact({}, study)


def _maze_showcase(params: Plain, inputs: Inputs) -> Artifact:
    models, stitchers = _shown_models(params, inputs)
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
KITCHEN_DATA = ("stitching.data.kitchen.demonstrations",)

BUILDERS: dict[str, Builder] = {
    "maze-demonstrations": Builder(_maze_demonstrations, ("stitching.data.maze",)),
    "maze-exploration": Builder(_maze_exploration, ("stitching.data.maze",)),
    "maze-showcase": Builder(_maze_showcase, ("stitching.showcase.maze", *PLANNERS)),
    "kitchen-demonstrations": Builder(_kitchen_demonstrations, KITCHEN_DATA),
    "kitchen-human": Builder(_kitchen_human, ("stitching.data.kitchen.human",)),
    "kitchen-held-out": Builder(_kitchen_held_out, KITCHEN_DATA),
    "kitchen-showcase": Builder(_kitchen_showcase, ("stitching.showcase.kitchen", *PLANNERS)),
    "kitchen-diagnosis": Builder(_kitchen_diagnosis, ("stitching.diagnosis",)),
    "agent": Builder(_agent, ("stitching.models.iql", "stitching.data.experience")),
    "mf-policy": Builder(_mf_policy, ("stitching.models.iql", "stitching.data.experience")),
    "dynamics": Builder(_dynamics, ("stitching.models.dynamics",)),
}
# What decides a block's outcome beside the models: Algorithm 1 and the planners.
BLOCK_CODE = ("stitching.rollout", *PLANNERS)
# And how work is set up, without the method's code that these import for other purposes.
SETUP_CODE = ("orchestrator.builders", "orchestrator.methods", "orchestrator.worker")
