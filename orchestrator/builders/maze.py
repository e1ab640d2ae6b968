"""The maze's data: demonstrations, and what is seen in between."""

from __future__ import annotations

from orchestrator.builders.own_data import own_data_builder
from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.envs.maze import MAZE


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return as_artifact(skill_demonstrations(MAZE, config, params["root_seed"]))


def _exploration(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return as_artifact(exploration(MAZE, config, params["root_seed"]))


SETUP = ("orchestrator.builders.maze", "orchestrator.builders.parts")

MAZE_BUILDERS = {
    "maze-demonstrations": Builder(_demonstrations, ("stitching.data.maze",), SETUP),
    "maze-exploration": Builder(_exploration, ("stitching.data.maze",), SETUP),
    "maze-own-data": own_data_builder({MAZE.name: MAZE}, ("stitching.envs.maze",)),
}
