"""What only the maze needs made: its data, and the paths of its figure."""

from __future__ import annotations

from orchestrator.builders.illustrations import shown_task
from orchestrator.builders.parts import LOOKING, PLANNERS, Builder, Inputs, as_artifact
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.data.maze import MazeDataConfig, exploration, skill_demonstrations
from stitching.data.transitions import Transitions
from stitching.envs.maze import MAZE
from stitching.showcase.maze import maze_showcase


def _demonstrations(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return as_artifact(skill_demonstrations(MAZE, config, params["root_seed"]))


def _exploration(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(MazeDataConfig, params["config"], "data")
    return as_artifact(exploration(MAZE, config, params["root_seed"]))


def _showcase(params: Plain, inputs: Inputs) -> Artifact:
    demonstrations = Transitions(**inputs["demonstrations"].arrays)
    return Artifact({}, maze_showcase(MAZE, demonstrations, shown_task(params, inputs)))


SETUP = ("orchestrator.builders.maze", "orchestrator.builders.parts")
SHOWN = ("stitching.showcase.maze", *PLANNERS)

MAZE_BUILDERS = {
    "maze-demonstrations": Builder(_demonstrations, ("stitching.data.maze",), SETUP),
    "maze-exploration": Builder(_exploration, ("stitching.data.maze",), SETUP),
    "maze-showcase": Builder(_showcase, SHOWN, (*SETUP, *LOOKING)),
}
