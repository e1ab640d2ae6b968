"""Kitchen's demonstrations of a long task, uncut, which Single-Policy learns from."""

from __future__ import annotations

from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.kitchen.demonstrations import KitchenDataConfig
from stitching.data.kitchen.long_horizon import long_horizon_data


def _kitchen_long_horizon(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    data, rewards = long_horizon_data(config, tuple(params["order"]), params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"rewards": rewards}, dataset.info)


SETUP = ("orchestrator.builders.long_horizon", "orchestrator.builders.parts")

LONG_HORIZON_BUILDERS = {
    "kitchen-long-horizon": Builder(
        _kitchen_long_horizon, ("stitching.data.kitchen.long_horizon",), SETUP
    ),
}
