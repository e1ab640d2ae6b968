"""What trained models are asked, and shown doing, for figures; no score depends on it.

Apart from what makes data: an edit there would rename all that was learned from them.
"""

from __future__ import annotations

import numpy as np

from orchestrator.builders.models import Configs, load_models
from orchestrator.builders.parts import Builder, Inputs
from orchestrator.methods import method_of
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.anatomy import Subject, anatomy
from stitching.data.transitions import Transitions, concatenate
from stitching.diagnosis import competence, prediction_errors, prices, value_progress
from stitching.envs import kitchen
from stitching.envs.kitchen import KITCHEN
from stitching.envs.maze import MAZE
from stitching.envs.registry import BENCHMARKS
from stitching.envs.robosuite import block as robosuite
from stitching.envs.robosuite.can import CAN
from stitching.envs.robosuite.door import DOOR
from stitching.forecast import pair_forecast
from stitching.methods.mb_stitch import MB_STITCH, MBStitch
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import Models, Stitcher
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.rollout import RolloutConfig
from stitching.showcase.maze import maze_showcase
from stitching.showcase.physics import physics_showcase
from stitching.showcase.shown import Shown

SCENES = {scene.name: scene for scene in (KITCHEN, DOOR, CAN)}
GROUPS = {
    KITCHEN.name: kitchen.GROUPS,
    DOOR.name: robosuite.GROUPS,
    CAN.name: robosuite.GROUPS,
}


def _configs(params: Plain) -> Configs:
    return {"dynamics": structure(DynamicsConfig, params["configs"]["dynamics"], "dynamics")}


def _stitcher(method: str, settings: Plain, models: Models) -> Stitcher:
    how = method_of(method)
    return how.stitcher(structure(how.settings, settings, f"method {method}"), models)


def _shown(params: Plain, inputs: Inputs) -> Shown:
    """What a showcase plays, from the parameters of its recipe."""
    models = load_models(BENCHMARKS[params["benchmark"]], _configs(params), inputs)
    return Shown(
        task=tuple(params["task"]),
        agent=models.agent,
        stitchers={
            method: _stitcher(method, settings, models) for method, settings in params["methods"]
        },
        rollout=structure(RolloutConfig, params["rollout"], "rollout"),
        step_limit=params["step_limit"],
        root_seed=params["root_seed"],
        seed=params["seed"],
    )


def _physics_showcase(params: Plain, inputs: Inputs) -> Artifact:
    return Artifact({}, physics_showcase(SCENES[params["benchmark"]], _shown(params, inputs)))


def _maze_showcase(params: Plain, inputs: Inputs) -> Artifact:
    demonstrations = Transitions(**inputs["demonstrations"].arrays)
    return Artifact({}, maze_showcase(MAZE, demonstrations, _shown(params, inputs)))


def _held_out(inputs: Inputs) -> tuple[Transitions, np.ndarray]:
    """The demonstrations that models are judged by, and the states that they begin in."""
    columns = dict(inputs["held-out"].arrays)
    starts = columns.pop("starts")
    return Transitions(**columns), starts


def _diagnosis(params: Plain, inputs: Inputs) -> Artifact:
    """What `stitching.diagnosis` knows of the models, on the data of the role "held-out"."""
    benchmark = BENCHMARKS[params["benchmark"]]
    models = load_models(benchmark, _configs(params), inputs)
    agent, dynamics = models.agent, models.one("dynamics", Dynamics)
    data, starts = _held_out(inputs)
    rollout = structure(RolloutConfig, params["rollout"], "rollout")
    played = rollout, params["step_limit"], data, starts, params["root_seed"], params["seed"]
    horizon = params["horizon"]
    study = {
        "predictions": prediction_errors(dynamics, data, GROUPS[benchmark.name], horizon),
        "values": value_progress(agent, benchmark, data),
        "prices": prices(agent, dynamics, benchmark, data, horizon),
        "competence": competence(agent, benchmark, *played),
    }
    return Artifact({}, study)


def _kitchen_diagnosis(params: Plain, inputs: Inputs) -> Artifact:
    """With which pairs of skills can be expected to work."""
    study = _diagnosis(params, inputs).info
    foretold = pair_forecast(KITCHEN, _held_out(inputs)[0], study["competence"])
    return Artifact({}, study | {"forecast": foretold})


def _anatomy(params: Plain, inputs: Inputs) -> Artifact:
    """Inputs beside the models are what the skills were learned from."""
    benchmark = BENCHMARKS[params["benchmark"]]
    models = load_models(benchmark, _configs(params), inputs)
    ((method, settings),) = params["methods"]
    stitcher = _stitcher(method, settings, models)
    assert isinstance(stitcher, MBStitch)
    subject = Subject(
        benchmark,
        models.agent,
        stitcher,
        structure(RolloutConfig, params["rollout"], "rollout"),
        params["step_limit"],
        params["root_seed"],
        params["seed"],
    )
    data = [
        Transitions(**inputs[role].arrays) for role in sorted(inputs) if role not in models.trained
    ]
    pairs = [(first, second) for first, second in params["pairs"]]
    return Artifact({}, anatomy(subject, concatenate(data), pairs, params["episodes"]))


PLAYED = (NO_STITCH.module, MB_STITCH.module)
SETUP = ("orchestrator.builders.studies", "orchestrator.builders.models", "orchestrator.methods")
SHOWCASE = Builder(_physics_showcase, ("stitching.showcase.physics", *PLAYED), SETUP)
ANATOMY = Builder(_anatomy, ("stitching.anatomy", *PLAYED), SETUP)

STUDY_BUILDERS = {
    "maze-showcase": Builder(_maze_showcase, ("stitching.showcase.maze", *PLAYED), SETUP),
    "kitchen-showcase": SHOWCASE,
    "kitchen-diagnosis": Builder(
        _kitchen_diagnosis, ("stitching.diagnosis", "stitching.forecast"), SETUP
    ),
    "kitchen-anatomy": ANATOMY,
    "robosuite-showcase": SHOWCASE,
    "robosuite-diagnosis": Builder(_diagnosis, ("stitching.diagnosis",), SETUP),
    "robosuite-anatomy": ANATOMY,
}
