"""Methods as specs name them, and how the first skills of a task are shared among them."""

from __future__ import annotations

import re
import tomllib
from dataclasses import is_dataclass, replace
from typing import Any

from orchestrator.errors import UsageError
from orchestrator.spec.structure import Plain, to_plain
from stitching.envs.first_times import FirstTimes
from stitching.envs.protocol import Benchmark, VectorEnv
from stitching.methods.no_stitch import NO_STITCH
from stitching.methods.protocol import Method, MethodSettings
from stitching.methods.registry import METHODS
from stitching.rollout import RolloutConfig

SHARED = ""
"""In the place of a method: the first skills of all that play them alike."""


def method_of(method: str) -> Method:
    """The registered method of `name` or `name[field=value,…]`; nothing is stitched in SHARED."""
    return NO_STITCH if method == SHARED else METHODS[method_name(method)]


def settings_with_effect(settings: MethodSettings) -> Plain:
    """As names of blocks contain them: what has no effect must not name anything."""
    plain: Plain = to_plain(settings)
    return {name: value for name, value in plain.items() if name not in settings.without_effect}


def playing_modules(method: str, settings: MethodSettings) -> set[str]:
    """The modules that decide what a method does: its own, and those of settings with an effect.

    A planner is its settings.
    """
    parts = [getattr(settings, name) for name in settings_with_effect(settings)]
    within = {type(part).__module__ for part in parts if is_dataclass(part)}
    return {type(settings).__module__, *method_of(method).modules, *within}


def first_method(method: str, rollout: RolloutConfig) -> str:
    """Whose a method's first skills are: its own where it plays them in a way of its own.

    Methods that execute skills by the same policies and do not stitch before a first one play it
    alike, and share it.
    """
    played = method_of(method)
    own = not played.told or (rollout.first_stitch and played.stitcher.before_first)
    return method if own else SHARED


def method_rollout(method: str, rollout: RolloutConfig) -> RolloutConfig:
    """What of the settings decides how a method's skills are executed.

    Where the policy is not told which skill is asked for, others may come in between: only the
    task's limit binds it. What cannot stitch to a first skill is played alike, asked to or not.
    """
    played = method_of(method)
    return replace(
        rollout,
        skill_limit=rollout.skill_limit if played.told else 0,
        first_stitch=rollout.first_stitch and played.stitcher.before_first,
    )


def method_env(method: str, benchmark: Benchmark) -> VectorEnv:
    """A new block of episodes, in which a method's skills are accomplished as is right for it.

    What a policy did before it was asked for, since nobody told it what to do, does not count.
    """
    env = benchmark.vector_env()
    return env if method_of(method).told else FirstTimes(env, len(benchmark.skills))


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
