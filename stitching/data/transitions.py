"""Offline data: flat columns of transitions with episode boundaries, kept as .npy files."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from stitching.envs.protocol import Benchmark

NO_SKILL = -1


class DataError(ValueError):
    """A dataset that must not be trained on; the message names the file and the row."""


@dataclass(frozen=True)
class Transitions:
    """E episodes of altogether N transitions, one after the other."""

    observations: np.ndarray  # (N, observation) float32
    actions: np.ndarray  # (N, action) float32; one-hot where actions are discrete
    next_observations: np.ndarray  # (N, observation) float32
    episode_ends: np.ndarray  # (E,) int64, one past each episode's last row
    episode_skills: np.ndarray  # (E,) int64, the demonstrated skill, NO_SKILL where there is none
    episode_successes: np.ndarray  # (E,) bool, whether the last transition achieves that skill

    def __len__(self) -> int:
        return len(self.actions)

    def columns(self) -> dict[str, np.ndarray]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def episode_starts(self) -> np.ndarray:
        """(E,) int64, each episode's first row."""
        return np.concatenate([[0], self.episode_ends[:-1]]).astype(np.int64)

    def episode_rows(self, skill: int) -> list[np.ndarray]:
        """Rows of each episode that demonstrates the skill."""
        chosen = np.flatnonzero(self.episode_skills == skill)
        starts = self.episode_starts
        return [np.arange(starts[e], self.episode_ends[e]) for e in chosen]


def concatenate(parts: list[Transitions]) -> Transitions:
    """The union of several datasets, in order."""
    columns = {
        name: np.concatenate([part.columns()[name] for part in parts])
        for name in parts[0].columns()
    }
    offsets = np.cumsum([0, *(len(part) for part in parts[:-1])])
    columns["episode_ends"] = np.concatenate(
        [part.episode_ends + offset for part, offset in zip(parts, offsets, strict=True)]
    )
    return Transitions(**columns)


KINDS = {
    "observations": np.float32,
    "actions": np.float32,
    "next_observations": np.float32,
    "episode_ends": np.int64,
    "episode_skills": np.int64,
    "episode_successes": np.bool_,
}


def check(data: Transitions, benchmark: Benchmark, source: str) -> None:
    """Refuse data of the wrong type or shape, or with impossible values, before any training.

    Raises DataError naming the column's file under `source` and the first bad row.
    """
    rows, episodes = len(data.actions), len(data.episode_ends)
    widths = {
        "observations": (benchmark.observation_size,),
        "actions": (benchmark.actions.size,),
        "next_observations": (benchmark.observation_size,),
    }
    for name, column in data.columns().items():
        shape = (rows, *widths[name]) if name in widths else (episodes,)
        if column.dtype != KINDS[name]:
            kind = np.dtype(KINDS[name]).name
            raise DataError(f"{source}/{name}.npy: type {column.dtype}, expected {kind}")
        if column.shape != shape:
            raise DataError(f"{source}/{name}.npy: shape {column.shape}, expected {shape}")
    if not rows or not episodes:
        raise DataError(f"{source}/episode_ends.npy: {episodes} episodes of {rows} transitions")

    for name in widths:
        finite = np.isfinite(getattr(data, name)).all(axis=1)
        _refuse(~finite, f"{source}/{name}.npy", "is not finite")
    outside = (np.abs(data.actions) > 1).any(axis=1)
    _refuse(outside, f"{source}/actions.npy", "has an action outside [-1, 1]")
    if benchmark.actions.discrete:
        one_hot = ((data.actions == 0) | (data.actions == 1)).all(axis=1)
        one_hot &= data.actions.sum(axis=1) == 1
        _refuse(~one_hot, f"{source}/actions.npy", "is no one-hot action")
    lengths = np.diff(data.episode_ends, prepend=0)
    wrong = (lengths <= 0) | (data.episode_ends > rows)
    wrong[-1] |= data.episode_ends[-1] != rows
    _refuse(wrong, f"{source}/episode_ends.npy", f"is wrong: ends must rise from above 0 to {rows}")
    skills = len(benchmark.skills)
    unknown = (data.episode_skills < NO_SKILL) | (data.episode_skills >= skills)
    if unknown.any():
        stray = data.episode_skills[np.argmax(unknown)]
        complaint = f"names skill {stray}, {benchmark.name} has {skills}"
        _refuse(unknown, f"{source}/episode_skills.npy", complaint)


def _refuse(bad: np.ndarray, file: str, complaint: str) -> None:
    """DataError at the first row of a mask, if it has any."""
    if bad.any():
        raise DataError(f"{file}: row {int(np.argmax(bad))} {complaint}")
