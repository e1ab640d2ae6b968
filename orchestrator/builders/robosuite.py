"""What only robosuite needs made: its data, and those that its models are judged by."""

from __future__ import annotations

from orchestrator.builders.illustrations import diagnosis, shown_task
from orchestrator.builders.parts import LOOKING, PLANNERS, Builder, Inputs, as_artifact
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.robosuite.demonstrations import RobosuiteDataConfig, collect, held_out
from stitching.envs.robosuite.block import GROUPS
from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door
from stitching.showcase.physics import physics_showcase

SCENES: dict[str, Door | Can] = {DOOR.name: DOOR, CAN.name: CAN}


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(RobosuiteDataConfig, params["config"], "data")
    return as_artifact(collect(SCENES[params["benchmark"]], config, params["root_seed"]))


def _held_out(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(RobosuiteDataConfig, params["config"], "data")
    data, starts = held_out(SCENES[params["benchmark"]], config, params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"starts": starts}, dataset.info)


def _showcase(params: Plain, inputs: Inputs) -> Artifact:
    return Artifact({}, physics_showcase(SCENES[params["benchmark"]], shown_task(params, inputs)))


def _diagnosis(params: Plain, inputs: Inputs) -> Artifact:
    return Artifact({}, diagnosis(SCENES[params["benchmark"]], GROUPS, params, inputs))


DATA = ("stitching.data.robosuite.demonstrations",)
SHOWN = ("stitching.showcase.physics", *PLANNERS)
SETUP = ("orchestrator.builders.robosuite", "orchestrator.builders.parts")

ROBOSUITE_BUILDERS = {
    "robosuite-demonstrations": Builder(_demonstrations, DATA, SETUP),
    "robosuite-held-out": Builder(_held_out, DATA, SETUP),
    "robosuite-showcase": Builder(_showcase, SHOWN, (*SETUP, *LOOKING)),
    "robosuite-diagnosis": Builder(_diagnosis, ("stitching.diagnosis",), (*SETUP, *LOOKING)),
}
