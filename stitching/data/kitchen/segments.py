"""Episodes of several skills, cut into skills where each is first achieved."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from stitching.data.transitions import DataError, Transitions
from stitching.envs.kitchen import SKILLS

Order = tuple[str, ...]


@dataclass(frozen=True)
class Episode:
    """What happened in T steps: one more observation than actions."""

    observations: np.ndarray  # (T + 1, 59) float32
    actions: np.ndarray  # (T, 9) float32
    achieved: np.ndarray  # (T + 1, 7) bool: which goals hold
    snapshots: np.ndarray  # (T + 1, snapshot) float64; no columns where nobody simulated it
    relocating: np.ndarray  # (T,) bool: steps that took the arm elsewhere, and are of no skill


@dataclass(frozen=True)
class Segment:
    """One skill of an episode: the steps that led to its first achievement, or that missed it."""

    episode: Episode
    start: int
    end: int  # one past the last step
    skill: int
    success: bool

    def __len__(self) -> int:
        return self.end - self.start


def cut(episode: Episode, order: Order = ()) -> list[Segment]:
    """The skills of an episode, each from the end of the one before to its own first achievement.

    Steps that took the arm elsewhere are of no segment: a skill begins where they ended. What an
    episode began with, or achieved in the same step as another skill, has no segment. Where
    an order was asked for, an accident ends the demonstration: nothing is kept from the first skill
    on that came out of turn. If there was none, the steps after the last achievement are a segment
    without success, of the skill that was due.
    """
    when = np.where(episode.achieved.any(axis=0), episode.achieved.argmax(axis=0), -1)  # (7,)
    shown = [skill for skill in np.argsort(when, kind="stable").tolist() if when[skill] > 0]
    due = [SKILLS.index(name) for name in order]
    if due:
        pairs = takewhile(lambda pair: pair[0] == pair[1], zip(shown, due, strict=False))
        kept = len(list(pairs))
    else:
        kept = len(shown)
    segments, end = [], 0
    for skill in shown[:kept]:
        start, end = _begins(episode, end, int(when[skill])), int(when[skill])
        if start < end:
            segments.append(Segment(episode, start, end, skill, True))
    last = len(episode.actions)
    start = _begins(episode, end, last)
    if kept == len(shown) < len(due) and start < last:
        segments.append(Segment(episode, start, last, due[kept], False))
    return segments


def _begins(episode: Episode, start: int, end: int) -> int:
    """The first step from start on that follows every relocation before end."""
    moved = np.flatnonzero(episode.relocating[start:end])
    return start + int(moved[-1]) + 1 if len(moved) else start


def shown_orders(demonstrations: Iterable[Sequence[Segment]]) -> list[Order]:
    """The distinct orders in which skills were accomplished, sorted."""
    shown = {tuple(SKILLS[s.skill] for s in one if s.success) for one in demonstrations}
    return sorted(shown - {()})


def as_transitions(segments: Sequence[Segment]) -> Transitions:
    """The segments' transitions, one episode each. DataError where there is no segment."""
    if not segments:
        raise DataError("no demonstration achieves a skill: nothing to make a dataset of")

    def stack(column: str, offset: int = 0) -> np.ndarray:
        rows = [getattr(s.episode, column)[s.start + offset : s.end + offset] for s in segments]
        return np.concatenate(rows)

    return Transitions(
        observations=stack("observations"),
        actions=stack("actions"),
        next_observations=stack("observations", 1),
        episode_ends=np.cumsum([len(s) for s in segments]),
        episode_skills=np.array([s.skill for s in segments], dtype=np.int64),
        episode_successes=np.array([s.success for s in segments]),
    )
