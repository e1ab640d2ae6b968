"""Our planner against published ones: plans per CPU second, and how good those plans are.

    pip install -e '.[bench]' -c constraints.txt            # torchrl
    pip install --no-deps --target .venv/mbrl mbrl==0.2.0   # mbrl-lib

What is installed of the two is measured. mbrl-lib cannot be part of the extra: it insists on
gymnasium 0.26.3 and hydra-core 1.0.3, and brings a top-level package `tests` that would hide ours.

All plan for the same states towards the same skills, under the same networks and Eq. 2. Ours goes
the way of a run: a block of ten episodes at once, `MBStitch.score`, table2's planner at table2's
precision. A reference gets one problem after another, in float32, at Table 7's limits: 500
iterations of 50 sequences of 5 actions, 10 elites, from N(0, 1), clipped to [-1, 1].

What they cannot mirror of Table 7: neither weights its elites by a temperature nor stops at
convergence, and torchrl's has no momentum. torchrl's plans in an environment that pays by the step
and returns the first action alone; here one step of it is a whole sequence, which spares it four
steps in five and shows all of its plan.

Every plan is judged by one scorer, in float32 and over all its actions, though only the first is
executed: by the objective gained over no action at all, the mean that planners start from. Models
are a Kitchen run's where `--run` is given one, else untrained.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import process_time

import numpy as np
import torch
from torch import Tensor

from orchestrator.builders.models import load_models
from orchestrator.spec.spec import Spec, load_spec
from orchestrator.spec.structure import to_plain
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import Arrays, Artifact, Store
from stitching.data.transitions import Transitions, concatenate
from stitching.envs.kitchen import KITCHEN
from stitching.methods.mb_stitch import MBStitch, MBStitchSettings
from stitching.models.dynamics import DynamicsConfig
from stitching.models.layers import init_mlp, prefixed
from stitching.planning.cem import CEM
from stitching.planning.protocol import Score
from stitching.streams import stream
from tests.bench.result import Result
from tests.sections import section, with_sections

BLOCKS = 3
SEED = 0
LIMITS = CEM()  # Table 7
STATE, ACTION = KITCHEN.observation_size, KITCHEN.actions.size

Objective = Callable[[Tensor], Tensor]
"""(population, horizon, action) → (population,), to be maximised."""


@dataclass(frozen=True)
class Reference:
    """A published planner, at Table 7's limits."""

    title: str
    modules: tuple[str, ...]
    install: str
    plan: Callable[[Objective, int], Tensor]  # (objective, iterations) → (horizon, action)


def mbrl_cem(objective: Objective, iterations: int) -> Tensor:
    from mbrl.planning.trajectory_opt import CEMOptimizer

    bound = np.ones((LIMITS.horizon, ACTION))
    optimizer = CEMOptimizer(
        num_iterations=iterations,
        elite_ratio=LIMITS.elites / LIMITS.population,
        population_size=LIMITS.population,
        lower_bound=(-bound).tolist(),
        upper_bound=bound.tolist(),
        alpha=LIMITS.momentum,
        device=torch.device("cpu"),
        return_mean_elites=True,  # the paper executes the mean
        clipped_normal=True,
    )
    return optimizer.optimize(objective, torch.zeros(LIMITS.horizon, ACTION))


def torchrl_cem(objective: Objective, iterations: int) -> Tensor:
    from tensordict import TensorDict
    from tensordict.nn import TensorDictModule
    from torchrl.data import Bounded, Composite, Unbounded
    from torchrl.envs.model_based import ModelBasedEnvBase
    from torchrl.modules import CEMPlanner

    class Imagination(ModelBasedEnvBase):
        """One step takes a whole sequence of actions, and pays what it is worth."""

        def __init__(self, world_model: TensorDictModule) -> None:
            super().__init__(world_model)
            self.observation_spec = Composite(start=Unbounded((1,)))
            self.state_spec = Composite(start=Unbounded((1,)))
            self.action_spec = Bounded(-1, 1, (LIMITS.horizon * ACTION,))
            self.reward_spec = Unbounded((1,))

        def _reset(self, tensordict: TensorDict, **options: object) -> TensorDict:
            return TensorDict({"start": torch.zeros(1)}, batch_size=[])

    def step(start: Tensor, sequences: Tensor) -> tuple[Tensor, Tensor]:
        worth = objective(sequences.unflatten(-1, (LIMITS.horizon, ACTION)))
        return start, worth[:, None]

    model = TensorDictModule(step, in_keys=["start", "action"], out_keys=["start", "reward"])
    planner = CEMPlanner(
        Imagination(model),
        planning_horizon=1,
        optim_steps=iterations,
        num_candidates=LIMITS.population,
        top_k=LIMITS.elites,
    )
    chosen = planner(TensorDict({"start": torch.zeros(1)}, batch_size=[]))
    return chosen["action"].unflatten(-1, (LIMITS.horizon, ACTION))


EXTRA = "pip install -e '.[bench]' -c constraints.txt"
MBRL = Path(sys.prefix, "mbrl")  # apart, for what it brings
REFERENCES = (
    Reference("torchrl's CEMPlanner", ("torchrl",), EXTRA, torchrl_cem),
    Reference(
        "mbrl's CEMOptimizer",
        ("mbrl", "hydra"),
        f"{EXTRA} and pip install --no-deps --target {MBRL} mbrl==0.2.0",
        mbrl_cem,
    ),
)


@dataclass(frozen=True)
class Problems:
    """A block as a run has it: where its episodes ended a skill, and the skill to stitch to."""

    previous: int
    following: int
    states: Tensor  # (episodes, observation)


@dataclass(frozen=True)
class Setting:
    title: str
    product: MBStitch  # at the precision of its models' training
    exact: MBStitch  # the same in float32
    blocks: list[Problems]


@dataclass
class Totals:
    """What one planner took, and what its plans are worth."""

    seconds: float = 0.0  # of CPU
    gains: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)  # of each plan

    @property
    def plans_per_second(self) -> float:
        return len(self.gains) / self.seconds


def measure(run: Path | None) -> Iterator[Result]:
    """Planners take turns, block by block, so that a busy spell of the machine meets them all."""
    there = list(_installed())
    if not there:
        return
    setting = _setting(run)
    ours, theirs = Totals(), [Totals() for _ in there]
    with torch.inference_mode():
        _warm_up(setting, there)
        for number, problems in enumerate(setting.blocks):
            score = setting.exact.score(problems.states, problems.following)
            _ours(ours, setting.product, problems, score, number)
            for reference, totals in zip(there, theirs, strict=True):
                _theirs(totals, reference, problems, score, number)
    for reference, totals in zip(there, theirs, strict=True):
        yield from _compared(setting.title, ours, reference.title, totals)


def _installed() -> Iterator[Reference]:
    """What there is to compare with; of the others, what to do to have them."""
    if MBRL.is_dir() and str(MBRL) not in sys.path:
        sys.path.append(str(MBRL))
    for reference in REFERENCES:
        if all(find_spec(module) for module in reference.modules):
            yield reference
        else:
            print(f"{'reference':<12}no {reference.title}: {reference.install}")


def _ours(totals: Totals, product: MBStitch, problems: Problems, exact: Score, number: int) -> None:
    streams = [stream("planner", SEED, number, row) for row in range(len(problems.states))]
    began = process_time()
    # What `propose` does before it keeps the first action.
    score = product.score(problems.states, problems.following)
    plan = product.settings.chosen.plan(score, streams, product.models.actions)
    totals.seconds += process_time() - began
    totals.iterations += plan.iterations.tolist()
    totals.gains += [
        _gain(partial(_of_one, exact, torch.tensor([row])), actions)
        for row, actions in enumerate(plan.actions)
    ]


def _theirs(
    totals: Totals, reference: Reference, problems: Problems, score: Score, number: int
) -> None:
    for row in range(len(problems.states)):
        objective = partial(_of_one, score, torch.tensor([row]))
        torch.manual_seed(number * len(problems.states) + row)
        began = process_time()
        actions = reference.plan(objective, LIMITS.iterations)
        totals.seconds += process_time() - began
        totals.iterations.append(LIMITS.iterations)
        totals.gains.append(_gain(objective, actions))


def _of_one(score: Score, problem: Tensor, actions: Tensor) -> Tensor:
    return score(problem, actions[None])[0]


def _gain(objective: Objective, plan: Tensor) -> float:
    """What a plan is worth beyond no action at all, the mean that all planners start from."""
    of_plan, of_none = objective(torch.stack([plan.clamp(-1, 1), torch.zeros_like(plan)]))
    return (of_plan - of_none).item()


def _warm_up(setting: Setting, references: list[Reference]) -> None:
    """Imports and first calls, which no run pays for every plan."""
    problems = setting.blocks[0]
    settings = with_sections(setting.product.settings, replace(LIMITS, iterations=2))
    product = replace(setting.product, settings=settings)
    score = setting.exact.score(problems.states, problems.following)
    _ours(Totals(), product, problems, score, 0)
    for reference in references:
        reference.plan(partial(_of_one, score, torch.tensor([0])), 2)


def _compared(models: str, ours: Totals, title: str, theirs: Totals) -> Iterator[Result]:
    yield Result(
        "reference",
        f"{models}: plans/s of CPU, over {title}",
        {
            "plans/s ours": ours.plans_per_second,
            "reference": theirs.plans_per_second,
            "iterations ours, mean": float(np.mean(ours.iterations)),
            "reference's": LIMITS.iterations,
            "plans": len(ours.gains),
        },
        ratio=ours.plans_per_second / theirs.plans_per_second,
        at_least=10,
    )
    better = np.subtract(ours.gains, theirs.gains)
    yield Result(
        "reference",
        f"{models}: objective gained, over {title}",
        {
            "gain ours, mean": float(np.mean(ours.gains)),
            "reference": float(np.mean(theirs.gains)),
            "difference": float(better.mean()),
            "its standard error": float(better.std(ddof=1) / np.sqrt(len(better))),
            "share of plans at least as good": float(np.mean(better >= 0)),
        },
        ratio=float(np.mean(ours.gains) / np.mean(theirs.gains)),
        at_least=1,
    )


def _setting(run: Path | None) -> Setting:
    spec = load_spec("table2")
    # Of the run's spec the benchmark alone, for older code may have written it.
    trained = (
        run is not None
        and json.loads((run / "spec.json").read_text())["benchmark"] == spec.benchmark
    )
    if run is not None and trained:
        models, config, data = _of_run(run)
        blocks = [_skill_ends(data, spec.block_episodes, number) for number in range(BLOCKS)]
    else:
        models, config = _untrained(spec), spec.dynamics
        blocks = [_random_states(spec.block_episodes, number) for number in range(BLOCKS)]
    settings = section(spec, MBStitchSettings)
    return Setting(
        "trained" if trained else "untrained",
        _stitcher(models, config, settings),
        _stitcher(models, replace(config, precision="float32"), settings),
        blocks,
    )


def _stitcher(
    models: dict[str, Arrays], config: DynamicsConfig, settings: MBStitchSettings
) -> MBStitch:
    info = {"config": to_plain(config)}
    artifacts = {kind: Artifact(arrays, info) for kind, arrays in models.items()}
    return MBStitch(settings, load_models(KITCHEN, artifacts))


def _of_run(run: Path) -> tuple[dict[str, Arrays], DynamicsConfig, Transitions]:
    """Weights of seed 0 by kind, the dynamics' configuration, and the demonstrations.

    Whatever code made them: a run keeps its store beside it, and its ledger names what it used.
    """
    store = Store(run.parent / "store")
    used = RunDirectory(run).ledger(read_only=True).artifacts()
    models: dict[str, Arrays] = {}
    config, data = DynamicsConfig(), []
    for kind, key in store.artifacts():
        params = store.manifest(kind, key)["made"]["params"]
        if key not in used:
            continue
        if kind in ("agent", "dynamics") and params["seed"] == 0:
            models[kind] = store.read(kind, key).arrays
            if kind == "dynamics":
                config = DynamicsConfig(**params["config"])
        elif kind == "kitchen-demonstrations":
            data.append(Transitions(**store.read(kind, key).arrays))
    if len(models) < 2 or not data:
        raise SystemExit(f"{run}: {store.root} holds no agent, dynamics and demonstrations of it")
    return models, config, concatenate(data)


def _skill_ends(data: Transitions, episodes: int, number: int) -> Problems:
    """Where demonstrations of a skill, drawn at random, ended; towards another one."""
    rng = stream("problems", SEED, number)
    previous, following = rng.choice(len(KITCHEN.skills), size=2, replace=False).tolist()
    shown = data.episode_successes & (data.episode_skills == previous)
    ends = rng.choice(data.episode_ends[shown] - 1, size=episodes, replace=False)
    return Problems(previous, following, torch.from_numpy(data.next_observations[ends]))


def _random_states(episodes: int, number: int) -> Problems:
    rng = stream("problems", SEED, number)
    states = rng.standard_normal((episodes, STATE), dtype=np.float32)
    return Problems(0, 1, torch.from_numpy(states))


def _untrained(spec: Spec) -> dict[str, Arrays]:
    """Fresh weights in table2's shapes."""
    rng = stream("models", SEED)
    scale: Arrays = {
        "observation_mean": np.zeros(STATE, dtype=np.float32),
        "observation_std": np.ones(STATE, dtype=np.float32),
    }
    asked = STATE + len(KITCHEN.skills[0].condition)
    hidden = [spec.agent.width] * spec.agent.hidden_layers
    policy = init_mlp(1, [asked, *hidden, ACTION], rng) | {"log_std": torch.zeros(ACTION)}
    v = init_mlp(spec.agent.members, [asked, *hidden, 1], rng)
    layers = [spec.dynamics.width] * spec.dynamics.hidden_layers
    t = init_mlp(spec.dynamics.members, [STATE + ACTION, *layers, STATE], rng)
    return {
        "agent": scale | prefixed(v, "v") | prefixed(policy, "policy"),
        "dynamics": scale | prefixed(t, "t"),
    }
