"""Offline data: flat columns of transitions with episode boundaries, kept as memory-mapped .npy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

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


def load(folder: Path) -> Transitions:
    """Memory-map a dataset; pickled arrays are refused, whatever their file name."""
    return Transitions(
        **{
            field.name: np.load(folder / f"{field.name}.npy", mmap_mode="r", allow_pickle=False)
            for field in fields(Transitions)
        }
    )


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


def check(data: Transitions, benchmark: Benchmark, source: str) -> None:
    """Refuse data of the wrong shape or with values that are not finite, before any training.

    Raises DataError naming the column's file under `source` and the first bad row.
    """
    observation, action = benchmark.observation_size, benchmark.actions.size
    rows, episodes = len(data.actions), len(data.episode_ends)
    expected: Mapping[str, tuple[int, ...]] = {
        "observations": (rows, observation),
        "actions": (rows, action),
        "next_observations": (rows, observation),
        "episode_ends": (episodes,),
        "episode_skills": (episodes,),
        "episode_successes": (episodes,),
    }
    for name, column in data.columns().items():
        file = f"{source}/{name}.npy"
        if column.shape != expected[name]:
            raise DataError(f"{file}: shape {column.shape}, expected {expected[name]}")
        finite = np.isfinite(column).reshape(len(column), -1).all(axis=1)
        if not finite.all():
            raise DataError(f"{file}: row {int(np.argmin(finite))} is not finite")
    if np.abs(data.actions).max(initial=0) > 1:
        row = int(np.argmax(np.abs(data.actions).max(axis=1) > 1))
        raise DataError(f"{source}/actions.npy: row {row} has an action outside [-1, 1]")
    lengths = np.diff(data.episode_ends, prepend=0)
    if not episodes or (lengths <= 0).any() or data.episode_ends[-1] != rows:
        row = int(np.argmax(lengths <= 0))
        raise DataError(
            f"{source}/episode_ends.npy: row {row}: ends must rise from above 0 to {rows}"
        )
    unknown = (data.episode_skills < NO_SKILL) | (data.episode_skills >= len(benchmark.skills))
    if unknown.any():
        row = int(np.argmax(unknown))
        raise DataError(
            f"{source}/episode_skills.npy: row {row} names skill {data.episode_skills[row]}, "
            f"{benchmark.name} has {len(benchmark.skills)}"
        )
