"""Kitchen's data: those that are learned from, and those that models are judged by."""

from __future__ import annotations

from orchestrator.builders.own_data import CODE as OWN_CODE
from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.kitchen.demonstrations import KitchenDataConfig, held_out, kept, play
from stitching.data.kitchen.human import human_demonstrations
from stitching.data.kitchen.segments import Segment, as_transitions, shown_orders
from stitching.data.own.labelled import are_labelled, labelled_data
from stitching.data.own.recordings import recordings
from stitching.data.transitions import DataError
from stitching.envs.kitchen import KITCHEN


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    return _cut_dataset(config, play(config, tuple(params["order"]), params["root_seed"]))


def _own(params: Plain, inputs: Inputs) -> Artifact:
    """Episodes without labels are cut into the skills that they show."""
    config = structure(KitchenDataConfig, params["config"], "data")
    episodes = recordings(config.own, KITCHEN)
    if are_labelled(episodes):
        return as_artifact(labelled_data(config.own, episodes, KITCHEN))
    demonstrations = human_demonstrations(episodes)
    if not any(demonstrations):
        raise DataError(f"{config.own}: no episode accomplishes a skill: nothing to learn one from")
    return _cut_dataset(config, demonstrations)


def _cut_dataset(config: KitchenDataConfig, demonstrations: list[list[Segment]]) -> Artifact:
    dataset = as_artifact(as_transitions(kept(config, demonstrations)))
    return Artifact(dataset.arrays, dataset.info | {"orders": shown_orders(demonstrations)})


def _held_out(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(KitchenDataConfig, params["config"], "data")
    data, starts = held_out(config, params["root_seed"])
    dataset = as_artifact(data)
    return Artifact(dataset.arrays | {"starts": starts}, dataset.info)


OWN_DATA = ("stitching.data.kitchen.human", *OWN_CODE)
DATA = ("stitching.data.kitchen.demonstrations",)
SETUP = ("orchestrator.builders.kitchen", "orchestrator.builders.parts")

KITCHEN_BUILDERS = {
    "kitchen-demonstrations": Builder(_demonstrations, DATA, SETUP),
    "kitchen-own-data": Builder(_own, OWN_DATA, SETUP, by_driver=True),
    "kitchen-held-out": Builder(_held_out, DATA, SETUP),
}
