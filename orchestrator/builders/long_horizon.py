"""Single-Policy: demonstrations of a long task, and the policy learned from them.

In a module of its own: an edit to one that trains the skills would rename them.
"""

from __future__ import annotations

from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from stitching.data.kitchen.long_horizon import long_horizon_data
from stitching.data.transitions import Transitions, check
from stitching.data.uncut import uncut_experience
from stitching.envs.registry import BENCHMARKS
from stitching.models.iql import IQLConfig, train_iql


def _kitchen_long_horizon(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    data, rewards = long_horizon_data(config, tuple(params["order"]), params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"rewards": rewards}, dataset.info)


def _single_policy(params: Plain, inputs: Inputs) -> Artifact:
    benchmark = BENCHMARKS[params["benchmark"]]
    config = structure(IQLConfig, params["config"], "single_policy.training")
    columns = dict(inputs["long-horizon"].arrays)
    rewards = columns.pop("rewards")
    data = Transitions(**columns)
    check(data, benchmark, source="long-horizon")
    labels = "single-policy", benchmark.name, params["root_seed"], params["seed"]
    trained = train_iql(uncut_experience(data, rewards), benchmark.actions, config, *labels)
    return Artifact(trained.weights, {"curves": trained.curves})


SETUP = ("orchestrator.builders.long_horizon", "orchestrator.builders.parts")

LONG_HORIZON_BUILDERS = {
    "kitchen-long-horizon": Builder(
        _kitchen_long_horizon, ("stitching.data.kitchen.long_horizon",), SETUP
    ),
    "single-policy": Builder(
        _single_policy, ("stitching.models.iql", "stitching.data.uncut"), SETUP
    ),
}
