"""What trained models are asked, and shown doing, for figures; no score depends on it.

Apart from what makes data: an edit there would rename all that was learned from them. The studies
of models and of stitches are imported where they are made: scipy and torch take seconds, which a
plan need not wait for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from orchestrator.builders.models import load_models
from orchestrator.builders.parts import Builder, Inputs
from orchestrator.spec.methods import method_of
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.data.transitions import Transitions, concatenate
from stitching.envs.maze import Maze
from stitching.envs.protocol import Benchmark
from stitching.methods.mb_stitch import MB_STITCH, MBStitch
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import Models, Stitcher
from stitching.models.dynamics import Dynamics
from stitching.rollout import RolloutConfig
from stitching.studies.showcase.maze import maze_showcase
from stitching.studies.showcase.physics import physics_showcase
from stitching.studies.showcase.shown import Shown


def _stitcher(method: str, settings: Plain, models: Models) -> Stitcher:
    played = method_of(method)
    return played.stitcher(structure(played.settings, settings, f"method {method}"), models)


def _shown(benchmark: Benchmark, params: Plain, inputs: Inputs) -> Shown:
    """What a showcase plays, from the parameters of its recipe."""
    models = load_models(benchmark, inputs)
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


PLAYED = tuple(sorted(NO_STITCH.modules | MB_STITCH.modules))  # planners: see the recipes
SETUP = (
    "orchestrator.builders.studies",
    "orchestrator.builders.models",
    "orchestrator.spec.methods",
)


def maze_showcase_builder(maze: Maze) -> Builder:
    """The paths of the maze's figure."""

    def make(params: Plain, inputs: Inputs) -> Artifact:
        demonstrations = Transitions(**inputs["demonstrations"].arrays)
        return Artifact({}, maze_showcase(maze, demonstrations, _shown(maze, params, inputs)))

    return Builder(make, ("stitching.studies.showcase.maze", *PLAYED), SETUP)


@dataclass(frozen=True)
class Studies:
    """Of benchmarks that are stepped by physics, alike but for their scenes."""

    family: str  # their kinds begin with it
    benchmarks: Mapping[str, Benchmark]  # by name
    groups: Mapping[str, slice]  # parts of an observation whose predictions are judged apart
    foretells: bool = False  # which pairs of skills can be expected to work

    @property
    def builders(self) -> dict[str, Builder]:
        judging = (
            "stitching.studies.diagnosis",
            *(["stitching.studies.forecast"] if self.foretells else []),
        )
        return {
            f"{self.family}-showcase": Builder(
                self._showcase, ("stitching.studies.showcase.physics", *PLAYED), SETUP
            ),
            f"{self.family}-diagnosis": Builder(self._diagnosis, judging, SETUP),
            f"{self.family}-stitches": Builder(
                self._stitches, ("stitching.studies.stitches", *PLAYED), SETUP
            ),
        }

    def _showcase(self, params: Plain, inputs: Inputs) -> Artifact:
        benchmark = self.benchmarks[params["benchmark"]]
        return Artifact({}, physics_showcase(benchmark, _shown(benchmark, params, inputs)))

    def _diagnosis(self, params: Plain, inputs: Inputs) -> Artifact:
        """What `stitching.studies.diagnosis` says of the models, on the held-out data."""
        from stitching.studies.diagnosis import (
            competence,
            prediction_errors,
            prices,
            value_progress,
        )
        from stitching.studies.forecast import pair_forecast

        benchmark = self.benchmarks[params["benchmark"]]
        models = load_models(benchmark, inputs)
        agent, dynamics = models.agent, models.one("dynamics", Dynamics)
        columns = dict(inputs["held-out"].arrays)
        starts = columns.pop("starts")
        data = Transitions(**columns)
        rollout = structure(RolloutConfig, params["rollout"], "rollout")
        played = rollout, params["step_limit"], data, starts, params["root_seed"], params["seed"]
        study: dict[str, Any] = {
            "predictions": prediction_errors(dynamics, data, self.groups, params["horizon"]),
            "values": value_progress(agent, benchmark, data),
            "prices": prices(agent, dynamics, benchmark, data, params["horizon"]),
            "competence": competence(agent, benchmark, *played),
        }
        if self.foretells:
            study["forecast"] = pair_forecast(benchmark, data, study["competence"])
        return Artifact({}, study)

    def _stitches(self, params: Plain, inputs: Inputs) -> Artifact:
        """Inputs beside the models are what the skills were learned from."""
        from stitching.studies.stitches import StudiedMethod, study_stitches

        benchmark = self.benchmarks[params["benchmark"]]
        models = load_models(benchmark, inputs)
        ((method, settings),) = params["methods"]
        stitcher = _stitcher(method, settings, models)
        assert isinstance(stitcher, MBStitch)
        studied = StudiedMethod(
            benchmark,
            models.agent,
            stitcher,
            structure(RolloutConfig, params["rollout"], "rollout"),
            params["step_limit"],
            params["root_seed"],
            params["seed"],
        )
        learned_from = (role for role in sorted(inputs) if role not in models.trained)
        data = concatenate([Transitions(**inputs[role].arrays) for role in learned_from])
        pairs = [(first, second) for first, second in params["pairs"]]
        return Artifact({}, study_stitches(studied, data, pairs, params["episodes"]))
