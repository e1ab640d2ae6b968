"""What is trained, the same for every benchmark."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orchestrator.benchmarks.registry import BENCHMARKS
from orchestrator.builders.parts import Builder, Inputs
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.corrections import Corrections
from stitching.data.experience import skill_experience
from stitching.data.initiation import initiation_set, pose_scale
from stitching.data.mixtures import mixed_experience, skill_pairs
from stitching.data.robot import RobotModel, before_contact
from stitching.data.swapping import Swapping
from stitching.data.transitions import Transitions, check, concatenate
from stitching.data.uncut import uncut_experience
from stitching.envs.factors import Factors
from stitching.envs.protocol import Benchmark, conditions
from stitching.models.agent import own_weights
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql, train_single_tasks
from stitching.models.layers import Params, parameters
from stitching.models.training import Curves, Trained


def _checked_data(params: Plain, inputs: Inputs) -> tuple[Benchmark, Transitions]:
    """The union of the input datasets, each checked before anything is trained on it."""
    benchmark = BENCHMARKS[params["benchmark"]]
    parts = []
    datasets = {role: artifact for role, artifact in inputs.items() if role != "agent"}
    for role, artifact in sorted(datasets.items()):
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
    actions, labels = benchmark.actions, _labels("agent", params)
    if not config.multi_task:
        if config.alters:
            raise NotImplementedError("networks of one skill each do not learn from altered data")
        return _trained(train_single_tasks(experience, actions, config, *labels))
    swapping = corrections = None
    if config.alters:
        about = (
            data,
            structure(Factors, params["factors"], "factors"),
            [skill.name for skill in benchmark.skills],
        )
        swapping = Swapping.of(*about, config.swap) if config.swap else None
        corrections = Corrections.of(*about, config.corrections) if config.corrections else None
    return _trained(
        train_iql(experience, actions, config, *labels, swapping=swapping, corrections=corrections)
    )


def _mf_policy(params: Plain, inputs: Inputs) -> Artifact:
    """The policy, and the condition of each pair of skills beside it."""
    benchmark, data = _checked_data(params, inputs)
    config = structure(IQLConfig, params["config"], "mf_stitch.training")
    skills = conditions(benchmark)
    experience = mixed_experience(data, skills, params["mixture"], config.gamma)
    starts = _next_policies(inputs["agent"], len(skills)) if "agent" in inputs else None
    actions, labels = benchmark.actions, _labels("mf-policy", params)
    if config.multi_task:
        # Then so is the agent, and the next skill's policy is the same for every pair.
        start = starts[0] if starts else None
        trained = train_iql(experience, actions, config, *labels, policy_from=start)
    else:
        trained = train_single_tasks(experience, actions, config, *labels, policies_from=starts)
        trained = replace(trained, curves=_averaged(trained.curves))
    weights = trained.weights | {"conditions": experience.conditions}
    return _trained(replace(trained, weights=weights))


def _next_policies(agent: Artifact, skills: int) -> list[Params]:
    """The policy of each pair's next skill."""
    own = own_weights(agent.arrays, skills)
    return [parameters(own[following], "policy") for _, following in skill_pairs(skills)]


def _averaged(curves: Curves) -> Curves:
    """Means over pairs of skills, which are too many to be looked at one by one."""
    by_name: dict[str, list[list[tuple[int, float]]]] = {}
    for name, curve in curves.items():
        by_name.setdefault(name.partition(" of ")[0], []).append(curve)
    return {
        name: [
            (points[0][0], float(np.mean([value for _, value in points])))
            for points in zip(*several, strict=True)
        ]
        for name, several in by_name.items()
    }


def _single_policy(params: Plain, inputs: Inputs) -> Artifact:
    benchmark = BENCHMARKS[params["benchmark"]]
    config = structure(IQLConfig, params["config"], "single_policy.training")
    columns = dict(inputs["long-horizon"].arrays)
    rewards = columns.pop("rewards")
    data = Transitions(**columns)
    check(data, benchmark, source="long-horizon")
    experience = uncut_experience(data, rewards)
    labels = _labels("single-policy", params)
    return _trained(train_iql(experience, benchmark.actions, config, *labels))


def _dynamics(params: Plain, inputs: Inputs) -> Artifact:
    _, data = _checked_data(params, inputs)
    config = structure(DynamicsConfig, params["config"], "dynamics")
    trained = train_dynamics(data, config, *_labels("dynamics", params))
    # How they compute is a part of what they are.
    return Artifact(trained.weights, {"curves": trained.curves, "config": params["config"]})


def _initiation_sets(params: Plain, inputs: Inputs) -> Artifact:
    """Every skill's initiation set, and how the robot moves: see `Initiation.of`."""
    benchmark, data = _checked_data(params, inputs)
    factors = structure(Factors, params["factors"], "factors")
    sets = [initiation_set(data, factors, skill) for skill in range(len(benchmark.skills))]
    arrays = {
        "columns": np.array(factors.pose),
        "scale": pose_scale(data, factors),
        "radii": np.array([one.radius for one in sets]),
    }
    for number, (skill, one) in enumerate(zip(benchmark.skills, sets, strict=True)):
        arrays[f"states.{number}"] = one.states
        arrays[f"others.{number}"] = np.array(factors.others_than(skill.name), dtype=np.int64)
    if not benchmark.actions.discrete:
        free = before_contact(data, factors, [skill.name for skill in benchmark.skills])
        model = RobotModel.of(data, free, factors)
        arrays["robot.columns"] = model.columns
        for name in ("drift", "effect", "offset"):
            arrays[f"robot.{name}"] = getattr(model, name).astype(np.float32)
    return Artifact(arrays, {"sizes": [len(one.states) for one in sets]})


SETUP = ("orchestrator.builders.training",)
LEARNING = ("stitching.models.iql", "stitching.data.experience")
MIXED = (*LEARNING, "stitching.data.mixtures", "stitching.models.agent")

TRAINING_BUILDERS = {
    "agent": Builder(_agent, LEARNING, SETUP),
    "mf-policy": Builder(_mf_policy, MIXED, SETUP),
    "single-policy": Builder(
        _single_policy, ("stitching.models.iql", "stitching.data.uncut"), SETUP
    ),
    "initiation-sets": Builder(
        _initiation_sets, ("stitching.data.initiation", "stitching.data.robot"), SETUP
    ),
    "dynamics": Builder(_dynamics, ("stitching.models.dynamics",), SETUP),
}
