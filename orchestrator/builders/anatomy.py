"""Stitches of trained models taken apart; no score depends on it.

In a module of its own: an edit to one that makes data would rename all that was learned from them.
"""

from __future__ import annotations

from orchestrator.builders.models import load_models
from orchestrator.builders.parts import PLANNERS, Builder, Inputs
from orchestrator.methods import make_stitcher
from orchestrator.store import Artifact
from orchestrator.structure import Plain, structure
from stitching.anatomy import Subject, anatomy
from stitching.data.transitions import Transitions, concatenate
from stitching.envs.registry import BENCHMARKS
from stitching.rollout import RolloutConfig
from stitching.stitchers import MBStitch


def _anatomy(params: Plain, inputs: Inputs) -> Artifact:
    """Inputs beside the models are what the skills were learned from."""
    benchmark = BENCHMARKS[params["benchmark"]]
    models = load_models(benchmark, params["configs"], inputs)
    ((method, settings),) = params["methods"]
    stitcher = make_stitcher(method, settings, benchmark, models["agent"], models)
    assert isinstance(stitcher, MBStitch)
    subject = Subject(
        benchmark,
        models["agent"],
        stitcher,
        structure(RolloutConfig, params["rollout"], "rollout"),
        params["step_limit"],
        params["root_seed"],
        params["seed"],
    )
    data = [Transitions(**inputs[role].arrays) for role in sorted(inputs) if role not in models]
    pairs = [(first, second) for first, second in params["pairs"]]
    return Artifact({}, anatomy(subject, concatenate(data), pairs, params["episodes"]))


ANATOMY = Builder(
    _anatomy,
    ("stitching.anatomy", *PLANNERS),
    (
        "orchestrator.builders.anatomy",
        "orchestrator.builders.models",
        "orchestrator.methods",
    ),
)

ANATOMY_BUILDERS = {"kitchen-anatomy": ANATOMY, "robosuite-anatomy": ANATOMY}
