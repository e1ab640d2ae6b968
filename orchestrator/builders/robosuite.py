"""Robosuite's data: those that are learned from, and those that models are judged by."""

from __future__ import annotations

from orchestrator.builders.own_data import own_data_builder
from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.robosuite.demonstrations import RobosuiteDataConfig, collect, held_out
from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door

SCENES: dict[str, Door | Can] = {DOOR.name: DOOR, CAN.name: CAN}


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(RobosuiteDataConfig, params["config"], "data")
    return as_artifact(collect(SCENES[params["benchmark"]], config, params["root_seed"]))


def _held_out(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(RobosuiteDataConfig, params["config"], "data")
    data, starts = held_out(SCENES[params["benchmark"]], config, params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"starts": starts}, dataset.info)


DATA = ("stitching.data.robosuite.demonstrations",)
SETUP = ("orchestrator.builders.robosuite", "orchestrator.builders.parts")

ROBOSUITE_BUILDERS = {
    "robosuite-demonstrations": Builder(_demonstrations, DATA, SETUP),
    "robosuite-held-out": Builder(_held_out, DATA, SETUP),
    "robosuite-own-data": own_data_builder(
        SCENES, ("stitching.envs.robosuite.can", "stitching.envs.robosuite.door")
    ),
}
