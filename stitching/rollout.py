"""Algorithm 1 for a block of episodes, one skill at a time, from snapshot to snapshot.

    for each skill k of a task:                          `play_from_start`; `play_segment` plays one
        while the stitch has steps left:                 `_stitch`
            plan actions from s towards skill k          `Stitcher.propose` (MB-Stitch: Eq. 2)
            execute them: s ← s'
            stop where V_k(s') no longer rises           `_value`
        while skill k is not accomplished:               `_execute`
            execute π(a | s, k): s ← s'
        stop where the steps of skill k are used up

The first skill is stitched to where `first_stitch` says so. An episode that does not accomplish a
skill goes no further.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np
import torch

from stitching.bounds import Amount, Bounded, NotNegative
from stitching.envs.protocol import ActionSpace, Benchmark, VectorEnv
from stitching.methods.protocol import Stitcher
from stitching.models.agent import Agent
from stitching.planning.objective import spread_over_members
from stitching.streams import stream


@dataclass(frozen=True)
class RolloutConfig(Bounded):
    """How skills are executed; step limits of whole tasks belong to the spec."""

    temperature: NotNegative = 0.0  # of the policy: 0 its mode, as in IQL; 1 as learned
    skill_limit: Amount = 0  # most steps of one skill, its stitch included; 0: the task's own
    stop_alpha: NotNegative = 0.0  # as α of Eq. 2, where a real state's value decides to stop
    first_stitch: bool = False  # stitch before a task's first skill, too, as Algorithm 1 is printed


@dataclass(frozen=True)
class Block:
    """Episodes of one node, played together; names every stream of randomness they draw from."""

    root_seed: int
    benchmark: str
    seed: int
    method: str
    episodes: tuple[int, ...]
    prefix: tuple[str, ...]  # skills up to and including the one being played

    def streams(self, purpose: str, *, by_method: bool = False) -> list[np.random.Generator]:
        """One stream per episode. Only stitchers draw by method; the rest is common to all."""
        method = (self.method,) if by_method else ()
        task = ">".join(self.prefix)
        return [
            stream(purpose, self.root_seed, self.benchmark, self.seed, *method, episode, task)
            for episode in self.episodes
        ]


@dataclass(frozen=True)
class Segments:
    """What happened to each of n episodes in one skill."""

    success: np.ndarray  # (n,) bool
    stitch_steps: np.ndarray  # (n,) int64
    steps: np.ndarray  # (n,) int64, stitching included
    value_start: np.ndarray  # (n,) float32, this skill's, before the stitch, to the stop rule
    value_end: np.ndarray  # (n,) float32, and after it
    snapshots: np.ndarray  # (n, snapshot) float64, at the segment's end


class Recorder(Protocol):
    """Is told of every step, for pictures and studies; changes nothing."""

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None: ...


@dataclass
class _Progress:
    """The moving parts of a segment."""

    env: VectorEnv
    skill: int
    episodes: np.ndarray  # (n,) their numbers
    budget: np.ndarray  # (n,) steps each may still take
    recorder: Recorder | None
    steps: np.ndarray = field(init=False)
    success: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        rows = np.arange(len(self.budget))
        self.steps = np.zeros(len(rows), dtype=np.int64)
        self.success = self.env.achieved(rows, self.skill)

    def open(self, rows: np.ndarray) -> np.ndarray:
        """Those of the rows that have neither achieved the skill nor used up their budget."""
        return rows[~self.success[rows] & (self.steps[rows] < self.budget[rows])]

    def step(self, rows: np.ndarray, actions: np.ndarray, phase: str) -> None:
        self.env.step(rows, actions)
        self.steps[rows] += 1
        self.success[rows] = self.env.achieved(rows, self.skill)
        if self.recorder is not None:
            self.recorder.step(self.env, rows, self.episodes[rows], self.skill, phase)


def play_segment(
    env: VectorEnv,
    agent: Agent,
    stitcher: Stitcher,
    benchmark: Benchmark,
    config: RolloutConfig,
    block: Block,
    budget: np.ndarray,
    recorder: Recorder | None = None,
) -> Segments:
    """Stitch to the last skill of `block.prefix` and execute it, for all episodes together.

    The environment stands at a skill boundary. A skill counts as accomplished at the first step at
    which its goal holds, stitching steps included. budget (n,) int64: steps left in each episode.
    """
    names = [skill.name for skill in benchmark.skills]
    skill = names.index(block.prefix[-1])
    rows = np.arange(len(block.episodes))
    if config.skill_limit:
        budget = np.minimum(budget, config.skill_limit)
    with torch.inference_mode():
        progress = _Progress(env, skill, np.array(block.episodes), budget, recorder)

        value = partial(_value, agent, config.stop_alpha, env)
        value_start = value(rows, skill)
        previous = names.index(block.prefix[-2]) if len(block.prefix) > 1 else None
        if previous is not None or (config.first_stitch and stitcher.before_first):
            _stitch(progress, stitcher, block, previous, value_start, value)
        stitch_steps = progress.steps.copy()
        value_end = value(rows, skill)
        _execute(progress, agent, benchmark, config, block)
        return Segments(
            success=progress.success,
            stitch_steps=stitch_steps,
            steps=progress.steps,
            value_start=value_start,
            value_end=value_end,
            snapshots=env.snapshot(rows),
        )


def _stitch(
    progress: _Progress,
    stitcher: Stitcher,
    block: Block,
    previous: int | None,
    value_start: np.ndarray,
    value: Callable[[np.ndarray, int], np.ndarray],
) -> None:
    """Stitching phase: until the skill is achieved, the steps are used up, the stitcher's limit is
    reached, the stitcher wants no more, or, where `until_value_falls`, the value after a whole
    proposal is no higher than after the one before."""
    streams = block.streams("planner", by_method=True)
    values = value_start.copy()
    rows = progress.open(np.arange(len(values)))
    while len(rows) and stitcher.limit:
        proposal = stitcher.propose(
            torch.from_numpy(progress.env.observe(rows)),
            previous,
            progress.skill,
            [streams[row] for row in rows],
        )
        rows, sequences = rows[proposal.wanted], proposal.actions[proposal.wanted]
        for step in range(sequences.shape[1]):
            if not len(rows):
                break
            progress.step(rows, sequences[:, step], "stitch")
            still = progress.open(rows)
            still = still[progress.steps[still] < stitcher.limit]
            sequences = sequences[np.isin(rows, still)]
            rows = still
        if stitcher.until_value_falls:
            new_values = value(rows, progress.skill)
            rising = new_values > values[rows]
            values[rows] = new_values
            rows = rows[rising]


def _execute(
    progress: _Progress,
    agent: Agent,
    benchmark: Benchmark,
    config: RolloutConfig,
    block: Block,
) -> None:
    """Execution phase: the skill's policy, until success or the end of the budget."""
    streams = block.streams("policy")
    rows = progress.open(np.arange(len(block.episodes)))
    while len(rows):
        states = torch.from_numpy(progress.env.observe(rows))
        noise = None
        if config.temperature:
            noise = policy_noise(benchmark.actions, [streams[row] for row in rows])
        actions = agent.act(states, progress.skill, noise, config.temperature)
        progress.step(rows, actions, "execute")
        rows = progress.open(rows)


def policy_noise(actions: ActionSpace, streams: Sequence[np.random.Generator]) -> np.ndarray:
    """One step's sampling noise from each stream: (n, 1) uniform, or (n, action) normal."""
    if actions.discrete:
        return np.array([[rng.random()] for rng in streams], dtype=np.float32)
    return np.stack([rng.standard_normal(actions.size, dtype=np.float32) for rng in streams])


def _value(agent: Agent, alpha: float, env: VectorEnv, rows: np.ndarray, skill: int) -> np.ndarray:
    """E[V] − stop_alpha · Var(V) of real states, (n,) float32: what the stop rule watches."""
    if not len(rows):
        return np.zeros(0, dtype=np.float32)
    values = agent.values(torch.from_numpy(env.observe(rows)), skill)
    return (values.mean(dim=0) - alpha * spread_over_members(values)).numpy()


def play_from_start(
    env: VectorEnv,
    agent: Agent,
    stitcher: Stitcher,
    benchmark: Benchmark,
    config: RolloutConfig,
    block: Block,
    step_limit: int,
    recorder: Recorder | None = None,
) -> list[Segments]:
    """The naive protocol: a whole task from the start, no tree; one `Segments` a skill.

    Skill k's Segments covers the episodes that accomplished the k − 1 before it. The rollout tree
    must give the same bytes.
    """
    episodes = np.array(block.episodes)
    used = np.zeros(len(episodes), dtype=np.int64)
    outcome: list[Segments] = []
    for depth in range(1, len(block.prefix) + 1):
        here = Block(
            block.root_seed,
            block.benchmark,
            block.seed,
            block.method,
            tuple(int(e) for e in episodes),
            block.prefix[:depth],
        )
        begin(env, here, outcome[-1].snapshots[outcome[-1].success] if outcome else None)
        budget = step_limit - used
        segments = play_segment(env, agent, stitcher, benchmark, config, here, budget, recorder)
        outcome.append(segments)
        used = (used + segments.steps)[segments.success]
        episodes = episodes[segments.success]
        if not len(episodes):
            break
    return outcome


def begin(env: VectorEnv, block: Block, snapshots: np.ndarray | None) -> None:
    """Start a segment: at the benchmark's start state (None), or at skill boundaries."""
    streams: Sequence[np.random.Generator] = block.streams("environment")
    if snapshots is None:
        env.reset(streams)
    else:
        env.restore(snapshots, streams)
