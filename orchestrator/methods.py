"""The methods of the tables: their settings, what each must have trained, and their labels."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from orchestrator.errors import UsageError
from orchestrator.structure import structure
from stitching.bounds import Amount, Bounded, Episodes, Few, NotNegative
from stitching.data.mixtures import Mixture, skill_pairs
from stitching.envs.first_times import FirstTimes
from stitching.envs.protocol import Benchmark, EpisodeBlock
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.models.iql import IQLConfig
from stitching.planning.cem import CEM
from stitching.planning.objective import Norm, Price
from stitching.planning.random_shooting import RandomShooting
from stitching.reach_stitch import ReachStitch
from stitching.rollout import RolloutConfig
from stitching.stitchers import MBStitch, MFStitch, NoStitch, RandomStitch, Stitcher


@dataclass(frozen=True)
class NoStitchConfig:
    """Direct chaining has nothing to set."""


@dataclass(frozen=True)
class RandomStitchConfig(Bounded):
    limit: Amount = 5  # most stitching steps between two skills


@dataclass(frozen=True)
class MFStitchConfig(Bounded):
    limit: Amount = 5
    mixture: Mixture = "fine-tuned"  # how the paper's "mixed" dataset is read
    training: IQLConfig = IQLConfig()  # the extra policy, learned from it


PlannerName = Literal["random-shooting", "cem"]


class PlanningConfig(Bounded):
    """What settings of all methods that plan have in common; each declares its own defaults."""

    planner: PlannerName
    random_shooting: RandomShooting
    cem: CEM

    @property
    def chosen(self) -> CEM | RandomShooting:
        """The planner's settings."""
        return self.cem if self.planner == "cem" else self.random_shooting


@dataclass(frozen=True)
class MBStitchConfig(PlanningConfig):
    limit: Amount = 5
    execute: Few = 1  # actions of each plan carried out before planning again
    alpha: NotNegative = 1.0  # α of Eq. 2, price of the value ensemble's disagreement
    beta: NotNegative = 1.0  # β of Eq. 2, price of the dynamics ensemble's disagreement
    norm: Norm = "mean"  # how Eq. 2's second variance becomes a number
    selective: bool = False  # act only on plans that promise more than the present
    price: Price = "end"  # Var(T) of a plan: of its last state, or the mean over its steps
    planner: PlannerName = "cem"
    random_shooting: RandomShooting = RandomShooting()
    cem: CEM = CEM()


@dataclass(frozen=True)
class ReachStitchConfig(PlanningConfig):
    limit: Amount = 20  # most stitching steps before a skill
    execute: Few = 1  # actions of each plan carried out before planning again
    beta: NotNegative = 0.5  # β of Eq. 2, beside a distance in standard deviations
    norm: Norm = "mean"  # as MB-Stitch's
    planner: PlannerName = "cem"
    random_shooting: RandomShooting = RandomShooting()
    cem: CEM = CEM(horizon=2, iterations=40, momentum=0.5, tolerance=0.15)


@dataclass(frozen=True)
class SinglePolicyConfig(Bounded):
    """One policy that is not told which skill is asked for (4.3.1): it takes no skill's vector."""

    task: str = ""  # what its demonstrations show, in this order and uncut: "a>b>c"
    episodes: Episodes = 240  # demonstrations
    training: IQLConfig = IQLConfig()


def check_start(config: MFStitchConfig, agent: IQLConfig, where: str) -> None:
    """Refuse to fine-tune a policy that could not be the one that the skills are learned by."""
    if config.mixture != "fine-tuned":
        return
    if config.training.policy_hidden != agent.policy_hidden:
        raise UsageError(
            f"{where}: hidden layers of {config.training.policy_hidden} cannot be fine-tuned from "
            f"the skills' policy with {agent.policy_hidden}; set training.policy_width and "
            "training.policy_layers to the agent's, or another mixture"
        )
    if config.training.multi_task and not agent.multi_task:
        raise UsageError(
            f"{where}: skills with a policy each are fine-tuned pair by pair; set "
            "training.multi_task to false, or another mixture"
        )


MethodConfig = (
    NoStitchConfig
    | RandomStitchConfig
    | MFStitchConfig
    | MBStitchConfig
    | ReachStitchConfig
    | SinglePolicyConfig
)
SKILLS = "agent"  # the kind of artifact whose policies are told which skill is asked for


@dataclass(frozen=True)
class Method:
    label: str
    config: type[MethodConfig]
    stitcher: type[Stitcher]
    needs: tuple[str, ...] = ()  # kinds of artifacts beside the policy
    policy: str = SKILLS  # kind of the artifact that executes skills

    @property
    def told(self) -> bool:
        """Whether its policy is told which skill is asked for."""
        return self.policy == SKILLS

    @property
    def artifacts(self) -> tuple[str, ...]:
        """Kinds of the artifacts that it is played with."""
        return (self.policy, *self.needs)


METHODS: dict[str, Method] = {
    "no-stitch": Method("No-Stitch", NoStitchConfig, NoStitch),
    "random-stitch": Method("Random-Stitch", RandomStitchConfig, RandomStitch),
    "mf-stitch": Method("MF-Stitch", MFStitchConfig, MFStitch, needs=("mf-policy",)),
    "mb-stitch": Method("MB-Stitch", MBStitchConfig, MBStitch, needs=("dynamics",)),
    "reach-stitch": Method(
        "Reach-Stitch", ReachStitchConfig, ReachStitch, needs=("dynamics", "initiation-sets")
    ),
    "single-policy": Method("Single-Policy", SinglePolicyConfig, NoStitch, policy="single-policy"),
}


SHARED_FIRST = Method("first skills, shared", NoStitchConfig, NoStitch)


def method_of(method: str) -> Method:
    """Its entry; the first skills that methods share have method ""."""
    return METHODS[method_name(method)] if method else SHARED_FIRST


def first_method(method: str, rollout: RolloutConfig) -> str:
    """Whose a method's first skills are: its own where it plays them in a way of its own, else "".

    Methods that execute skills by the same policies and do not stitch before a first one play it
    alike, and share it.
    """
    how = method_of(method)
    own = not how.told or (rollout.first_stitch and how.stitcher.before_first)
    return method if own else ""


def method_rollout(method: str, rollout: RolloutConfig) -> RolloutConfig:
    """What of the settings decides how a method's skills are executed.

    Where the policy is not told which skill is asked for, others may come in between: only the
    task's limit binds it. What cannot stitch to a first skill is played alike, asked to or not.
    """
    how = method_of(method)
    return replace(
        rollout,
        skill_limit=rollout.skill_limit if how.told else 0,
        first_stitch=rollout.first_stitch and how.stitcher.before_first,
    )


def method_block(method: str, benchmark: Benchmark) -> EpisodeBlock:
    """A new block of episodes, in which a method's skills are accomplished as is right for it.

    What a policy did before it was asked for, since nobody told it what to do, does not count.
    """
    block = benchmark.block()
    return block if method_of(method).told else FirstTimes(block, len(benchmark.skills))


def parse_method(method: str) -> tuple[str, dict[str, Any]]:
    """ "mb-stitch[alpha=1,beta=10]" → ("mb-stitch", {"alpha": 1, "beta": 10}).

    Raises UsageError, listing the methods there are.
    """
    match = re.fullmatch(r"([\w-]+)(?:\[(.*)\])?", method)
    if match is None:
        raise UsageError(f"method {method!r}: write name or name[field=value,field=value]")
    name, inner = match.groups()
    if name not in METHODS:
        raise UsageError(f"unknown method {name!r}; there are {', '.join(METHODS)}")
    settings = [item.partition("=") for item in (inner or "").split(",") if item]
    return name, {key.strip(): _scalar(text.strip()) for key, _, text in settings}


def method_name(method: str) -> str:
    """The method without its settings."""
    return parse_method(method)[0]


def _scalar(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def method_label(method: str) -> str:
    """How tables print a method: "MB-Stitch [alpha=1,beta=10]"."""
    name, _ = parse_method(method)
    return method.replace(name, METHODS[name].label, 1).replace("[", " [", 1)


def make_stitcher(
    method: str,
    settings: dict[str, Any],
    benchmark: Benchmark,
    agent: Agent,
    models: Mapping[str, Any],
) -> Stitcher:
    """The stitcher of a method, from its plain settings and the models it needs, by kind.

    The first skills that methods share have method "": nothing is stitched there.
    """
    config = structure(method_of(method).config, settings, f"method {method}")
    if isinstance(config, RandomStitchConfig):
        return RandomStitch(benchmark.actions, config.limit)
    if isinstance(config, MFStitchConfig):
        pairs = {pair: row for row, pair in enumerate(skill_pairs(len(benchmark.skills)))}
        return MFStitch(models["mf-policy"], pairs, config.limit)
    if isinstance(config, MBStitchConfig):
        dynamics: Dynamics = models["dynamics"]
        return MBStitch(
            agent,
            dynamics,
            config.chosen,
            benchmark.actions,
            config.alpha,
            config.beta,
            config.norm,
            config.execute,
            config.limit,
            config.selective,
            config.price,
        )
    if isinstance(config, ReachStitchConfig):
        return ReachStitch(
            models["initiation-sets"],
            models["dynamics"],
            config.chosen,
            benchmark.actions,
            config.beta,
            config.norm,
            config.execute,
            config.limit,
        )
    if method_of(method).stitcher is not NoStitch:
        raise NotImplementedError(f"method {method}: nothing makes its stitcher")
    return NoStitch()
