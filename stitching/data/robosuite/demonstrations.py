"""Scripted demonstrations of the robosuite skills, each from the start of its own task.

Where the paper's data came from it does not say; its ablation has levels of quality, and so have
these. Opening begins at the closed door, closing at an open one with the arm at home, so that no
demonstration of closing begins where opening ends. A can is always the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stitching.bounds import Amount, Bounded, Count, Episodes, Share
from stitching.data.robosuite.programs import ScriptedDemonstrator, style
from stitching.data.transitions import DataError, Transitions
from stitching.envs.protocol import skill_index
from stitching.envs.robosuite.can import Can
from stitching.envs.robosuite.door import DOOR, SKILLS, Door
from stitching.streams import stream


@dataclass(frozen=True)
class RobosuiteDataConfig(Bounded):
    """Robosuite's demonstrations: how many, and how good the demonstrator is."""

    quality: Share = 1.0  # of the demonstrator: from 1, an expert, down to 0, who often misses
    episodes: Episodes = 100  # demonstrations a skill
    held_out: Amount = 50  # more of each skill, to judge models by
    skill_steps: Count = 40  # actions after which a skill counts as missed
    keep_failures: bool = True  # what a poor demonstrator misses is data, too
    file: str = ""  # own data in place of these: an .npz file or the id of a Minari dataset


@dataclass(frozen=True)
class Demonstration:
    """One skill, from its start to its success or to the last step."""

    observations: np.ndarray  # (T + 1, 25) float32
    actions: np.ndarray  # (T, 5) float32
    skill: int
    success: bool
    start: np.ndarray  # (snapshot,) float64


def starts(benchmark: Door | Can, skill: int) -> Door | Can:
    """The benchmark as demonstrations of a skill begin."""
    return (
        Door(starts_open=True) if benchmark is DOOR and SKILLS[skill] == "close door" else benchmark
    )


def demonstrate(
    benchmark: Door | Can,
    config: RobosuiteDataConfig,
    skill: str,
    seed: int,
    episodes: Sequence[int] | None = None,
) -> list[Demonstration]:
    """An episode depends on the configuration, the seed, its skill and its number alone.

    Physics that diverge end their episode before the step that did it.
    """
    index = skill_index(benchmark, skill)
    numbers = range(config.episodes) if episodes is None else episodes
    labels = [("demonstrations", benchmark.name, seed, skill, int(number)) for number in numbers]
    env = starts(benchmark, index).vector_env()
    env.reset([stream("environment", *label) for label in labels])
    manner = style(config.quality)
    demonstrators = [
        ScriptedDemonstrator(skill, benchmark.workspace, manner, stream("hand", *label))
        for label in labels
    ]
    rows = np.arange(len(demonstrators))
    snapshots = env.snapshot(rows)
    seen = [[observation] for observation in env.observe(rows)]
    acted: list[list[np.ndarray]] = [[] for _ in demonstrators]
    success = np.zeros(len(demonstrators), dtype=bool)
    for _ in range(config.skill_steps):
        actions = np.array([demonstrators[row].act(seen[row][-1]) for row in rows])
        env.step(rows, actions)
        sound = ~env.diverged[rows]
        rows, actions = rows[sound], actions[sound]
        for row, action, observation in zip(rows, actions, env.observe(rows), strict=True):
            acted[row].append(action)
            seen[row].append(observation)
        success[rows] = env.achieved(rows, index)
        rows = rows[~success[rows]]
        if not len(rows):
            break
    return [
        Demonstration(
            np.array(o), np.array(a, dtype=np.float32).reshape(-1, 5), index, bool(done), start
        )
        for o, a, done, start in zip(seen, acted, success, snapshots, strict=True)
    ]


def collect(benchmark: Door | Can, config: RobosuiteDataConfig, seed: int) -> Transitions:
    """Demonstrations of all skills of a benchmark, one skill after the other."""
    kept = [
        demonstration
        for skill in benchmark.skills
        for demonstration in demonstrate(benchmark, config, skill.name, seed)
        if len(demonstration.actions) and (demonstration.success or config.keep_failures)
    ]
    return _as_transitions(kept)


def held_out(
    benchmark: Door | Can, config: RobosuiteDataConfig, seed: int
) -> tuple[Transitions, np.ndarray]:
    """Demonstrations that no model has seen, and the state each began in.

    E episodes, those that missed included: a poor demonstrator succeeds from its easier starts.
    Their snapshots: (E, snapshot) float64.
    """
    numbers = range(config.episodes, config.episodes + config.held_out)
    kept = [
        demonstration
        for skill in benchmark.skills
        for demonstration in demonstrate(benchmark, config, skill.name, seed, numbers)
        if len(demonstration.actions)
    ]
    return _as_transitions(kept), np.array([one.start for one in kept])


def _as_transitions(kept: Sequence[Demonstration]) -> Transitions:
    if not any(demonstration.success for demonstration in kept):
        raise DataError("no demonstration achieves its skill: nothing to make a dataset of")
    return Transitions(
        observations=np.concatenate([one.observations[:-1] for one in kept]),
        actions=np.concatenate([one.actions for one in kept]),
        next_observations=np.concatenate([one.observations[1:] for one in kept]),
        episode_ends=np.cumsum([len(one.actions) for one in kept]),
        episode_skills=np.array([one.skill for one in kept], dtype=np.int64),
        episode_successes=np.array([one.success for one in kept]),
    )
