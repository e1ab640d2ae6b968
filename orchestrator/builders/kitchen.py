"""What only Kitchen needs made: its data, and those that its models are judged by."""

from __future__ import annotations

from orchestrator.builders.illustrations import diagnosis, shown_task
from orchestrator.builders.parts import LOOKING, PLANNERS, Builder, Inputs, as_artifact
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.kitchen.demonstrations import KitchenDataConfig, held_out, kept, play
from stitching.data.kitchen.human import human_demonstrations
from stitching.data.kitchen.segments import Segment, as_transitions, shown_orders
from stitching.data.transitions import Transitions
from stitching.envs.kitchen import GROUPS, KITCHEN
from stitching.forecast import pair_forecast
from stitching.showcase.physics import physics_showcase


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    return _cut_dataset(config, play(config, tuple(params["order"]), params["root_seed"]))


def _human(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    return _cut_dataset(config, human_demonstrations(config.human))


def _cut_dataset(config: KitchenDataConfig, demonstrations: list[list[Segment]]) -> Artifact:
    dataset = as_artifact(as_transitions(kept(config, demonstrations)))
    return Artifact(dataset.arrays, dataset.info | {"orders": shown_orders(demonstrations)})


def _held_out(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    data, starts = held_out(config, params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"starts": starts}, dataset.info)


def _showcase(params: Plain, inputs: Inputs) -> Artifact:
    return Artifact({}, physics_showcase(KITCHEN, shown_task(params, inputs)))


def _diagnosis(params: Plain, inputs: Inputs) -> Artifact:
    study = diagnosis(KITCHEN, GROUPS, params, inputs)
    held = {name: held for name, held in inputs["held-out"].arrays.items() if name != "starts"}
    foretold = pair_forecast(KITCHEN, Transitions(**held), study["competence"])
    return Artifact({}, study | {"forecast": foretold})


DATA = ("stitching.data.kitchen.demonstrations",)
SHOWN = ("stitching.showcase.physics", *PLANNERS)
JUDGED = ("stitching.diagnosis", "stitching.forecast")
SETUP = ("orchestrator.builders.kitchen", "orchestrator.builders.parts")

KITCHEN_BUILDERS = {
    "kitchen-demonstrations": Builder(_demonstrations, DATA, SETUP),
    "kitchen-human": Builder(_human, ("stitching.data.kitchen.human",), SETUP),
    "kitchen-held-out": Builder(_held_out, DATA, SETUP),
    "kitchen-showcase": Builder(_showcase, SHOWN, (*SETUP, *LOOKING)),
    "kitchen-diagnosis": Builder(_diagnosis, JUDGED, (*SETUP, *LOOKING)),
}
