"""A car on a straight track with three flags: a benchmark in one file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.benchmarks.entry import BenchmarkEntry, Costs, Dataset
from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain, structure
from orchestrator.storage.store import Artifact
from stitching.bounds import Bounded, Episodes, Share
from stitching.data.transitions import Transitions
from stitching.envs.factors import Factors
from stitching.envs.protocol import ActionSpace, Skill
from stitching.streams import stream

FLAGS = {"left": -0.6, "middle": 0.3, "right": 0.8}
NEAR = 0.05  # of a flag, where it counts as reached
LONGEST = 60  # steps of a demonstration


@dataclass(frozen=True)
class Track:
    """Position and speed; an action is an acceleration. The car starts at 0, at rest."""

    name = "track"
    observation_size = snapshot_size = 2
    actions = ActionSpace(size=1, discrete=False)
    factors = Factors(pose=(0,))
    skills = tuple(Skill(name, (place,)) for name, place in FLAGS.items())

    def vector_env(self) -> TrackVectorEnv:
        return TrackVectorEnv()


class TrackVectorEnv:
    """N cars. The track is deterministic, so the noise streams go unused."""

    def __init__(self) -> None:
        self._states = np.zeros((0, 2))  # position, speed

    def reset(self, streams: Sequence[np.random.Generator]) -> None:
        self._states = np.zeros((len(streams), 2))

    def restore(self, snapshots: np.ndarray, streams: Sequence[np.random.Generator]) -> None:
        self._states = snapshots.copy()

    def snapshot(self, rows: np.ndarray) -> np.ndarray:
        return self._states[rows]

    def observe(self, rows: np.ndarray) -> np.ndarray:
        return self._states[rows].astype(np.float32)

    def step(self, rows: np.ndarray, actions: np.ndarray) -> None:
        position, speed = self._states[rows].T
        speed = 0.8 * speed + 0.05 * actions[:, 0]
        self._states[rows] = np.stack([np.clip(position + speed, -1, 1), speed], axis=1)

    def achieved(self, rows: np.ndarray, skill: int) -> np.ndarray:
        place = list(FLAGS.values())[skill]
        return np.abs(self._states[rows, 0] - place) < NEAR


@dataclass(frozen=True)
class TrackData(Bounded):
    episodes: Episodes = 30  # demonstrations a skill
    noise: Share = 0.2  # spread of what is added to the driver's actions


def demonstrations(config: TrackData, seed: int) -> Transitions:
    """From the start to each flag: towards it, and slower the nearer it is."""
    everyone = np.arange(config.episodes)
    observations, actions, following, ends, skills, successes = [], [], [], [], [], []
    for skill, (name, place) in enumerate(FLAGS.items()):
        rng = stream("demonstrations", "track", seed, name)
        env = TrackVectorEnv()
        env.reset([rng] * config.episodes)
        drives: list[list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = [[] for _ in everyone]
        for _ in range(LONGEST):
            rows = everyone[~env.achieved(everyone, skill)]
            before = env.observe(rows)
            wanted = 8 * (place - before[:, :1]) - 6 * before[:, 1:]
            noise = config.noise * rng.standard_normal((len(rows), 1))
            chosen = np.clip(wanted + noise, -1, 1).astype(np.float32)
            env.step(rows, chosen)
            for row, *step in zip(rows, before, chosen, env.observe(rows), strict=True):
                drives[row].append((step[0], step[1], step[2]))
        reached = env.achieved(everyone, skill)
        for drive, success in zip(drives, reached, strict=True):
            for seen, action, after in drive:
                observations.append(seen)
                actions.append(action)
                following.append(after)
            ends.append(len(actions))
            skills.append(skill)
            successes.append(success)
    return Transitions(
        np.array(observations),
        np.array(actions),
        np.array(following),
        np.array(ends, dtype=np.int64),
        np.array(skills, dtype=np.int64),
        np.array(successes),
    )


def _build(params: Plain, inputs: Inputs) -> Artifact:
    config = structure(TrackData, params["config"], "data")
    return as_artifact(demonstrations(config, params["root_seed"]))


TRACK = Track()
TRACK_ENTRY = BenchmarkEntry(
    TRACK,
    TrackData,
    lambda config: {"demonstrations": Dataset("track-demonstrations")},
    {"track-demonstrations": Builder(_build, ("track",), ("orchestrator.builders.parts",))},
    Costs(segment=0.002),
)
