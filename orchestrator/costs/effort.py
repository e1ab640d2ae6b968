"""What trainings and plans take of a core, counted from their settings.

The constants were measured on one core of a 2-core cloud machine, in float32, with networks of 64
to 1,024 units, 1 to 20 members and minibatches of 32 to 2,048: what is counted lies within a factor
of two of the time that was taken. bfloat16 takes some two thirds.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

from orchestrator.benchmarks.registry import BENCHMARKS, ENTRIES
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import structure
from orchestrator.work.recipes import Recipe
from stitching.data.mixtures import skill_pairs
from stitching.envs.protocol import Benchmark, conditions
from stitching.methods.planning import PlanningSettings
from stitching.methods.protocol import MethodSettings
from stitching.models.dynamics import DynamicsConfig
from stitching.models.iql import IQLConfig

MULTIPLY_ADDS = 3e10  # a second
UPDATE_SECONDS = 1.5e-3  # of an update, whatever its size
PARAMETER_SECONDS = 2.5e-9  # of an update, for each parameter that Adam changes
FORWARD_PASSES = 3  # that a forward and a backward pass cost as much as
NUMBER_BYTES = 4


@dataclass(frozen=True)
class Training:
    """How much there is to be learned."""

    updates: int  # of all networks that are learned one after the other
    batch: int  # transitions an update
    learned: int  # parameters that an update changes
    copies: int = 0  # parameters of slow copies
    networks: int = 1  # learned one after the other

    @property
    def seconds(self) -> float:
        """Of one core."""
        multiply_adds = self.batch * (FORWARD_PASSES * self.learned + self.copies)
        each = UPDATE_SECONDS + PARAMETER_SECONDS * self.learned + multiply_adds / MULTIPLY_ADDS
        return self.updates * each

    @property
    def bytes(self) -> int:
        """On disk, at most."""
        return NUMBER_BYTES * self.networks * (self.learned + self.copies)


def training_of(recipe: Recipe) -> Training | None:
    """What is trained by a recipe, if anything is."""
    benchmark = BENCHMARKS[recipe.params["benchmark"]]
    config = recipe.params.get("config", {})
    if recipe.kind == "dynamics":
        dynamics = structure(DynamicsConfig, config, recipe.kind)
        size = dynamics_parameters(dynamics, benchmark)
        return Training(dynamics.updates, dynamics.batch_size, size)
    skills = len(benchmark.skills)
    one_by_one = {"agent": skills, "mf-policy": len(skill_pairs(skills)), "single-policy": 1}
    if recipe.kind not in one_by_one:
        return None
    iql = structure(IQLConfig, config, recipe.kind)
    networks = 1 if iql.multi_task else one_by_one[recipe.kind]
    state, action = _state_size(benchmark), benchmark.actions.size
    hidden = [iql.width] * iql.hidden_layers
    q = 2 * iql.members * _parameters([state + action, *hidden, 1])
    policy = _parameters([state, *iql.policy_hidden, action])
    learned = q + value_parameters(iql, benchmark) + policy
    return Training(networks * iql.updates, iql.batch_size, learned, q, networks)


def value_parameters(config: IQLConfig, benchmark: Benchmark) -> int:
    """Of all members of the value ensemble."""
    hidden = [config.width] * config.hidden_layers
    return config.members * _parameters([_state_size(benchmark), *hidden, 1])


def dynamics_parameters(config: DynamicsConfig, benchmark: Benchmark) -> int:
    """Of all members of the dynamics ensemble."""
    size = benchmark.observation_size
    hidden = [config.width] * config.hidden_layers
    return config.members * _parameters([size + benchmark.actions.size, *hidden, size])


def planning_seconds(spec: Spec, settings: MethodSettings, *, until_value_falls: bool) -> float:
    """Of the plans in one segment; 0 where a method makes none.

    A plan imagines each of its sequences step by step by every member of the dynamics, and judges
    the end by every value. Stitches that a falling value ends come to few plans. Of the others,
    half of what is allowed is taken: they end where they have arrived.
    """
    if not isinstance(settings, PlanningSettings):
        return 0.0
    benchmark, planner = BENCHMARKS[spec.benchmark], settings.chosen
    sequence = planner.horizon * dynamics_parameters(spec.dynamics, benchmark)
    sequence += value_parameters(spec.agent, benchmark)
    most = ceil(getattr(settings, "limit", 1) / getattr(settings, "execute", 1))
    plans = min(ENTRIES[spec.benchmark].costs.plans, most) if until_value_falls else most / 2
    return plans * planner.samples * sequence / MULTIPLY_ADDS


def _state_size(benchmark: Benchmark) -> int:
    """Numbers that policies and values are shown: an observation and a skill's condition."""
    return benchmark.observation_size + conditions(benchmark).shape[1]


def _parameters(sizes: list[int]) -> int:
    """Weights and biases of a network with these many numbers in each layer."""
    return sum(above * below + below for above, below in pairwise(sizes))
