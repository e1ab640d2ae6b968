"""Stitches taken apart: what was planned and what came of it, step by step, and whether it helped.

Each pair of skills goes on twice from the states in which No-Stitch's first one ended, without a
stitch and with MB-Stitch: so of every stitch it is known what would have happened without it. Where
Algorithm 1 stitches before a task's first skill, too, each of these is played twice from the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import Any, ClassVar

import numpy as np
import torch

from stitching.data.transitions import Transitions
from stitching.envs.protocol import Benchmark, VectorEnv
from stitching.methods.mb_stitch import MBStitch
from stitching.methods.no_stitch import NoStitch
from stitching.methods.protocol import Proposal, Stitcher
from stitching.models.agent import Agent
from stitching.planning.objective import NORMS, spread_over_members
from stitching.planning.protocol import PlannedActions
from stitching.rollout import Block, Recorder, RolloutConfig, Segments, begin, play_segment
from stitching.studies.demonstrated_states import DemonstratedStates

DIGITS = 5  # after the point, of what is recorded

START = ""
"""In the place of a pair's first skill: there is none, an episode starts."""

Pair = tuple[str, str]  # two skills, in their order
Numbers = dict[str, float]


@dataclass(frozen=True)
class StudiedMethod:
    """Whose stitches are looked at, played as an evaluation plays them."""

    benchmark: Benchmark
    agent: Agent
    stitcher: MBStitch
    rollout: RolloutConfig
    step_limit: int  # of both skills together
    root_seed: int
    seed: int

    def segment(
        self,
        block: Block,
        snapshots: np.ndarray | None,
        stitcher: Stitcher,
        budget: np.ndarray,
        recorder: Recorder | None = None,
    ) -> Segments:
        """The last skill of a block, from the start (None) or from where another one ended."""
        begin(self._env, block, snapshots)
        return play_segment(
            self._env, self.agent, stitcher, self.benchmark, self.rollout, block, budget, recorder
        )

    def boundary(self, block: Block, snapshots: np.ndarray | None) -> torch.Tensor:
        """What such a segment begins with: (n, observation)."""
        begin(self._env, block, snapshots)
        return torch.from_numpy(self._env.observe(np.arange(len(block.episodes))))

    @cached_property
    def _env(self) -> VectorEnv:
        return self.benchmark.vector_env()

    def number(self, skill: str) -> int:
        return [each.name for each in self.benchmark.skills].index(skill)

    def block(self, method: str, episodes: Sequence[int], *prefix: str) -> Block:
        name = self.benchmark.name
        return Block(self.root_seed, name, self.seed, method, tuple(episodes), prefix)


@dataclass
class Trace:
    """One stitch of n steps and its plans; `as_plain` is what figures read."""

    value: list[float] = field(default_factory=list)  # (n + 1) E[V] of real states, start first
    spread: list[float] = field(default_factory=list)  # (n + 1) of the value's members there
    distance: list[float] = field(default_factory=list)  # (n + 1) to the next skill's own data
    plans: list[Numbers] = field(default_factory=list)  # those made, see `StitchRecorder.foresee`

    def as_plain(self) -> dict[str, Any]:
        return dict(vars(self))


class StitchRecorder:
    """MB-Stitch that writes down what it expects, and the recorder of what then happens.

    Both at once, for a stitch's steps follow its plans. Changes nothing in either.
    """

    def __init__(self, studied: StudiedMethod, near: DemonstratedStates) -> None:
        self._stitcher = studied.stitcher
        self._agent, self._near = studied.agent, near
        self._expected: list[Numbers] = []  # of plans whose first action is still to be taken
        self.traces: dict[int, Trace] = {}  # by episode

    before_first: ClassVar[bool] = MBStitch.before_first
    until_value_falls: ClassVar[bool] = MBStitch.until_value_falls

    @property
    def limit(self) -> int:
        return self._stitcher.limit

    def propose(
        self,
        states: torch.Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        plan = self._stitcher.plan(states, following, streams)
        proposal = self._stitcher.proposal(plan, states, following)
        expected = self.foresee(states, following, plan)
        self._expected = list(compress(expected, proposal.wanted))
        return proposal

    def foresee(self, states: torch.Tensor, following: int, plan: PlannedActions) -> list[Numbers]:
        """The three terms of Eq. 2 one action ahead, unweighted, and Eq. 2 at the plan's end.

        For each of the states (n, observation): "value" E[v(s')], "spread" Var(v(s')) and
        "disagreement" Var(T(s'|s, a)), averaged over dimensions in units of the data's scale;
        "objective" is the planner's own score.
        """
        dynamics = self._stitcher.dynamics
        imagined = dynamics.imagine(states, plan.actions[:, :1])  # (D, n, observation)
        values = self._agent.values(imagined.mean(dim=0), following)  # (M, n)
        columns = {
            "value": values.mean(dim=0),
            "spread": spread_over_members(values),
            "disagreement": NORMS["mean"](spread_over_members(dynamics.scaled(imagined))),
            "objective": plan.objective,
        }
        return [
            {name: round(float(column[row]), DIGITS) for name, column in columns.items()}
            for row in range(len(states))
        ]

    def look(self, states: torch.Tensor, episodes: Sequence[int], skill: int) -> None:
        """Write down real states (n, observation) of these episodes."""
        values = self._agent.values(states, skill)
        distances = self._near.distances(self._stitcher.dynamics.scaled(states))
        columns = values.mean(dim=0), spread_over_members(values), distances
        for episode, *numbers in zip(episodes, *columns, strict=True):
            trace = self.traces.setdefault(int(episode), Trace())
            value, spread, distance = (round(float(number), DIGITS) for number in numbers)
            trace.value.append(value)
            trace.spread.append(spread)
            trace.distance.append(distance)

    def step(
        self, env: VectorEnv, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        if phase != "stitch":
            return
        if self._expected:  # the first action of plans that were made for these very rows
            for episode, expected in zip(episodes, self._expected, strict=True):
                trace = self.traces[int(episode)]
                trace.plans.append({"step": len(trace.value) - 1, **expected})
            self._expected = []
        self.look(torch.from_numpy(env.observe(rows)), episodes.tolist(), skill)


@torch.inference_mode()
def study_stitches(
    studied: StudiedMethod, data: Transitions, pairs: Sequence[Pair], episodes: int
) -> dict[str, Any]:
    """The first `episodes` episodes of every pair of skills, with and without MB-Stitch, as JSON.

    Where first skills are stitched to, too, those of the pairs are played both ways from the start
    of an episode, as pairs whose "first" is START. "pairs" tells how many episodes came to each
    stitch; "stitches" has one entry for each of these, with the outcome of the second skill both
    ways; "typical_distance" says by skill how near to one another demonstrations are.
    data: what the skills were learned from.
    """
    dynamics = studied.stitcher.dynamics
    ends = {skill: _end_of(studied, skill, episodes) for skill in sorted({a for a, _ in pairs})}
    places = {pair: ends[pair[0]] for pair in pairs}
    if studied.rollout.first_stitch:
        start = Boundary(range(episodes), None, np.full(episodes, studied.step_limit))
        places = {(START, skill): start for skill in ends} | places
    near = {
        skill: DemonstratedStates.of(data, studied.number(skill), dynamics)
        for skill in sorted({second for _, second in places})
    }
    typical = {skill: around.typical() for skill, around in near.items()}
    return {
        "episodes": episodes,
        "limit": studied.stitcher.limit,
        "alpha": studied.stitcher.settings.alpha,
        "beta": studied.stitcher.settings.beta,
        "typical_distance": {
            skill: None if distance is None else round(distance, DIGITS)
            for skill, distance in typical.items()
        },
        "pairs": [
            {"first": first, "second": second, "arrived": len(place.episodes)}
            for (first, second), place in places.items()
        ],
        "stitches": [
            stitch
            for pair, place in places.items()
            if place.episodes
            for stitch in _both_ways(studied, near[pair[1]], pair, place)
        ],
    }


@dataclass(frozen=True)
class Boundary:
    """Where n episodes stand before a skill."""

    episodes: Sequence[int]  # their numbers
    snapshots: np.ndarray | None  # (n, snapshot); None: at the start
    budget: np.ndarray  # (n,) steps that are left


def _end_of(studied: StudiedMethod, skill: str, episodes: int) -> Boundary:
    """Where No-Stitch's first skill succeeded."""
    budget = np.full(episodes, studied.step_limit)
    first = studied.segment(studied.block("", range(episodes), skill), None, NoStitch(), budget)
    succeeded = np.flatnonzero(first.success)
    return Boundary(
        succeeded.tolist(), first.snapshots[succeeded], (budget - first.steps)[succeeded]
    )


def _both_ways(
    studied: StudiedMethod, near: DemonstratedStates, pair: Pair, place: Boundary
) -> list[dict[str, Any]]:
    """Every episode that stands before the pair's second skill, without and with a stitch."""
    prefix = [skill for skill in pair if skill != START]
    plain = studied.segment(
        studied.block("no-stitch", place.episodes, *prefix),
        place.snapshots,
        NoStitch(),
        place.budget,
    )
    recorder = StitchRecorder(studied, near)
    block = studied.block("mb-stitch", place.episodes, *prefix)
    before = studied.boundary(block, place.snapshots)
    recorder.look(before, place.episodes, studied.number(pair[1]))
    stitched = studied.segment(block, place.snapshots, recorder, place.budget, recorder)
    return [
        {
            "first": pair[0],
            "second": pair[1],
            "episode": episode,
            "succeeds_without": bool(plain.success[row]),
            "succeeds_with": bool(stitched.success[row]),
            "steps_without": int(plain.steps[row]),
            "steps_with": int(stitched.steps[row]),
            **recorder.traces[episode].as_plain(),
        }
        for row, episode in enumerate(place.episodes)
    ]
