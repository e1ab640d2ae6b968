"""What trained models are asked, and shown doing, for figures; no score depends on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from orchestrator.builders.models import load_models
from orchestrator.builders.parts import Inputs
from orchestrator.methods import make_stitcher
from orchestrator.structure import Plain, structure
from stitching.data.transitions import Transitions
from stitching.diagnosis import competence, prediction_errors, prices, value_progress
from stitching.envs.protocol import Benchmark
from stitching.envs.registry import BENCHMARKS
from stitching.rollout import RolloutConfig
from stitching.showcase.shown import Shown


def shown_task(params: Plain, inputs: Inputs) -> Shown:
    """What a showcase plays, from the parameters of its recipe."""
    benchmark = BENCHMARKS[params["benchmark"]]
    models = load_models(benchmark, params["configs"], inputs)
    return Shown(
        task=tuple(params["task"]),
        agent=models["agent"],
        stitchers={
            method: make_stitcher(method, settings, benchmark, models["agent"], models)
            for method, settings in params["methods"]
        },
        rollout=structure(RolloutConfig, params["rollout"], "rollout"),
        step_limit=params["step_limit"],
        root_seed=params["root_seed"],
        seed=params["seed"],
    )


def diagnosis(
    benchmark: Benchmark, groups: Mapping[str, slice], params: Plain, inputs: Inputs
) -> dict[str, Any]:
    """What `stitching.diagnosis` knows of the models, on the data of the role "held-out"."""
    models = load_models(benchmark, params["configs"], inputs)
    agent, dynamics = models["agent"], models["dynamics"]
    columns = dict(inputs["held-out"].arrays)
    starts = columns.pop("starts")
    data = Transitions(**columns)
    rollout = structure(RolloutConfig, params["rollout"], "rollout")
    seeds = params["root_seed"], params["seed"]
    return {
        "predictions": prediction_errors(dynamics, data, groups, params["horizon"]),
        "values": value_progress(agent, benchmark, data),
        "prices": prices(agent, dynamics, benchmark, data, params["horizon"]),
        "competence": competence(
            agent, benchmark, rollout, params["step_limit"], data, starts, *seeds
        ),
    }
