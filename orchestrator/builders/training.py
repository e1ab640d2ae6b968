"""What is trained, the same for every benchmark."""

from __future__ import annotations

from orchestrator.builders.parts import Builder, Inputs
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.experience import mixed_experience, skill_experience
from stitching.data.transitions import Transitions, check, concatenate
from stitching.envs.protocol import Benchmark, conditions
from stitching.envs.registry import BENCHMARKS
from stitching.models.dynamics import DynamicsConfig, train_dynamics
from stitching.models.iql import IQLConfig, train_iql, train_single_tasks
from stitching.models.training import Trained


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
    train = train_iql if config.multi_task else train_single_tasks
    return _trained(train(experience, benchmark.actions, config, *_labels("agent", params)))


def _mf_policy(params: Plain, inputs: Inputs) -> Artifact:
    benchmark, data = _checked_data(params, inputs)
    config = structure(IQLConfig, params["config"], "mf_stitch.training")
    experience = mixed_experience(data, conditions(benchmark))
    return _trained(train_iql(experience, benchmark.actions, config, *_labels("mf-policy", params)))


def _dynamics(params: Plain, inputs: Inputs) -> Artifact:
    _, data = _checked_data(params, inputs)
    config = structure(DynamicsConfig, params["config"], "dynamics")
    return _trained(train_dynamics(data, config, *_labels("dynamics", params)))


SETUP = ("orchestrator.builders.training",)
LEARNING = ("stitching.models.iql", "stitching.data.experience")

TRAINING_BUILDERS = {
    "agent": Builder(_agent, LEARNING, SETUP),
    "mf-policy": Builder(_mf_policy, LEARNING, SETUP),
    "dynamics": Builder(_dynamics, ("stitching.models.dynamics",), SETUP),
}
