"""Stitches taken apart: what was planned and what came of it, step by step, and whether it helped.

Each pair of skills goes on twice from the states in which the first one ended, without a stitch and
with MB-Stitch: so of every stitch it is known what would have happened without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import compress
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from stitching.data.transitions import Transitions
from stitching.envs.protocol import ActionSpace, Benchmark, EpisodeBlock
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics
from stitching.planning.objective import NORMS, spread_over_members
from stitching.planning.protocol import Plan, Planner, Score
from stitching.rollout import Play, Recorder, RolloutConfig, Segments, begin, play_segment
from stitching.stitchers import MBStitch, NoStitch, Proposal, Stitcher

SAMPLED_STATES = 200  # of a skill's demonstrations, to say how near to one another they are
DIGITS = 5  # after the point, of what is recorded

Pair = tuple[str, str]  # two skills, in their order
Numbers = dict[str, float]


@dataclass(frozen=True)
class Subject:
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
        play: Play,
        snapshots: np.ndarray | None,
        stitcher: Stitcher,
        budget: np.ndarray,
        recorder: Recorder | None = None,
    ) -> Segments:
        """The last skill of a play, from the start (None) or from where another one ended."""
        begin(self._block, play, snapshots)
        return play_segment(
            self._block, self.agent, stitcher, self.benchmark, self.rollout, play, budget, recorder
        )

    def boundary(self, play: Play, snapshots: np.ndarray) -> Tensor:
        """What such a segment begins with: (n, observation)."""
        begin(self._block, play, snapshots)
        return torch.from_numpy(self._block.observe(np.arange(len(play.episodes))))

    @cached_property
    def _block(self) -> EpisodeBlock:
        return self.benchmark.block()

    def number(self, skill: str) -> int:
        return [each.name for each in self.benchmark.skills].index(skill)

    def play(self, method: str, episodes: Sequence[int], *prefix: str) -> Play:
        name = self.benchmark.name
        return Play(self.root_seed, name, self.seed, method, tuple(episodes), prefix)


@dataclass(frozen=True)
class Surroundings:
    """The states in which one skill was demonstrated, and how far from them others are.

    Distances are Euclidean, every dimension in units of its standard deviation in the data, over
    the square root of their number: 1 is one standard deviation in every dimension.
    """

    states: Tensor  # (N, observation), in those units
    demonstrations: Tensor  # (N,) int64, which of them each state is of

    @classmethod
    def of(cls, data: Transitions, skill: int, dynamics: Dynamics) -> Surroundings:
        rows = data.episode_rows(skill)
        numbers = np.repeat(np.arange(len(rows)), [len(each) for each in rows])
        chosen = np.concatenate([np.empty(0, dtype=np.int64), *rows])
        states = dynamics.scaled(torch.from_numpy(data.observations[chosen]))
        return cls(states, torch.from_numpy(numbers))

    def distances(self, states: Tensor) -> Tensor:
        """To the nearest demonstrated state: (n, observation), in the data's units → (n,)."""
        return self._gaps(states).amin(dim=1)

    def typical(self) -> float | None:
        """Median distance of a demonstrated state to the nearest one of another demonstration.

        None where there is but one. Of at most 200 states, evenly chosen.
        """
        if self.demonstrations.unique().numel() < 2:
            return None
        count = len(self.states)
        shown = torch.linspace(0, count - 1, min(SAMPLED_STATES, count)).long()
        same = self.demonstrations[shown][:, None] == self.demonstrations
        gaps = self._gaps(self.states[shown]).masked_fill(same, torch.inf)
        return round(float(gaps.amin(dim=1).median()), DIGITS)

    def _gaps(self, states: Tensor) -> Tensor:
        """(n, observation) → (n, N). Without the matrix product, which is inexact near zero."""
        exact = "donot_use_mm_for_euclid_dist"
        return torch.cdist(states, self.states, compute_mode=exact) / states.shape[1] ** 0.5


@dataclass
class Remembering:
    """A planner that keeps the plan it made last."""

    planner: Planner
    last: Plan | None = None

    def plan(
        self, score: Score, streams: Sequence[np.random.Generator], actions: ActionSpace
    ) -> Plan:
        self.last = self.planner.plan(score, streams, actions)
        return self.last


@dataclass
class Trace:
    """One stitch of n steps and its plans; `as_plain` is what figures read."""

    value: list[float] = field(default_factory=list)  # (n + 1) E[V] of real states, start first
    spread: list[float] = field(default_factory=list)  # (n + 1) of the value's members there
    distance: list[float] = field(default_factory=list)  # (n + 1) to the next skill's own data
    plans: list[Numbers] = field(default_factory=list)  # those made, see `Witness.foresee`

    def as_plain(self) -> dict[str, Any]:
        return dict(vars(self))


class Witness:
    """MB-Stitch that writes down what it expects, and the recorder of what then happens.

    Both at once, for a stitch's steps follow its plans. Changes nothing in either.
    """

    def __init__(self, subject: Subject, near: Surroundings) -> None:
        self._planner = Remembering(subject.stitcher.planner)
        self._stitcher = replace(subject.stitcher, planner=self._planner)
        self._agent, self._near = subject.agent, near
        self._expected: list[Numbers] = []  # of plans whose first action is still to be taken
        self.traces: dict[int, Trace] = {}  # by episode

    before_first: ClassVar[bool] = MBStitch.before_first

    @property
    def limit(self) -> int:
        return self._stitcher.limit

    def propose(
        self,
        states: Tensor,
        previous: int | None,
        following: int,
        streams: Sequence[np.random.Generator],
    ) -> Proposal:
        proposal = self._stitcher.propose(states, previous, following, streams)
        assert self._planner.last is not None
        expected = self.foresee(states, following, self._planner.last)
        self._expected = list(compress(expected, proposal.wanted))
        return proposal

    def foresee(self, states: Tensor, following: int, plan: Plan) -> list[Numbers]:
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

    def look(self, states: Tensor, episodes: Sequence[int], skill: int) -> None:
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
        self, block: EpisodeBlock, rows: np.ndarray, episodes: np.ndarray, skill: int, phase: str
    ) -> None:
        if phase != "stitch":
            return
        if self._expected:  # the first action of plans that were made for these very rows
            for episode, expected in zip(episodes, self._expected, strict=True):
                trace = self.traces[int(episode)]
                trace.plans.append({"step": len(trace.value) - 1, **expected})
            self._expected = []
        self.look(torch.from_numpy(block.observe(rows)), episodes.tolist(), skill)


@torch.inference_mode()
def anatomy(
    subject: Subject, data: Transitions, pairs: Sequence[Pair], episodes: int
) -> dict[str, Any]:
    """The first `episodes` episodes of every pair of skills, with and without MB-Stitch, as JSON.

    "pairs" tells how many of them came to a stitch; "stitches" has one entry for each of these,
    with the outcome of the second skill both ways; "typical_distance" says by skill how near to one
    another demonstrations are. data: what the skills were learned from.
    """
    dynamics = subject.stitcher.dynamics
    firsts = {skill: _first(subject, skill, episodes) for skill in sorted({a for a, _ in pairs})}
    near = {
        skill: Surroundings.of(data, subject.number(skill), dynamics)
        for skill in sorted({second for _, second in pairs})
    }
    stitches: list[dict[str, Any]] = []
    for pair in pairs:
        if firsts[pair[0]].success.any():
            stitches += _stitches(subject, near[pair[1]], firsts[pair[0]], pair)
    return {
        "episodes": episodes,
        "limit": subject.stitcher.limit,
        "alpha": subject.stitcher.alpha,
        "beta": subject.stitcher.beta,
        "typical_distance": {skill: around.typical() for skill, around in near.items()},
        "pairs": [
            {"first": first, "second": second, "arrived": int(firsts[first].success.sum())}
            for first, second in pairs
        ],
        "stitches": stitches,
    }


def _first(subject: Subject, skill: str, episodes: int) -> Segments:
    """A first skill, which is the same for every method."""
    budget = np.full(episodes, subject.step_limit)
    return subject.segment(subject.play("", range(episodes), skill), None, NoStitch(), budget)


def _stitches(
    subject: Subject, near: Surroundings, first: Segments, pair: Pair
) -> list[dict[str, Any]]:
    """Every episode in which the first skill succeeded, both ways from there."""
    episodes = np.flatnonzero(first.success).tolist()
    snapshots = first.snapshots[first.success]
    budget = subject.step_limit - first.steps[first.success]
    plain = subject.segment(
        subject.play("no-stitch", episodes, *pair), snapshots, NoStitch(), budget
    )
    witness = Witness(subject, near)
    play = subject.play("mb-stitch", episodes, *pair)
    witness.look(subject.boundary(play, snapshots), episodes, subject.number(pair[1]))
    stitched = subject.segment(play, snapshots, witness, budget, witness)
    return [
        {
            "first": pair[0],
            "second": pair[1],
            "episode": episode,
            "succeeds_without": bool(plain.success[row]),
            "succeeds_with": bool(stitched.success[row]),
            "steps_without": int(plain.steps[row]),
            "steps_with": int(stitched.steps[row]),
            **witness.traces[episode].as_plain(),
        }
        for row, episode in enumerate(episodes)
    ]
