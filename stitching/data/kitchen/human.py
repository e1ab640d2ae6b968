"""Recordings of the kitchen without labels, such as Minari's `D4RL/kitchen/*`, cut into skills.

Which skill an episode shows, and where it ends, is read off the observed objects, never off the
dataset's name or its infos: Minari's descriptions of `partial` and `mixed` are swapped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stitching.data.kitchen.segments import Episode, Segment, cut
from stitching.data.own.recording import Recording
from stitching.envs.kitchen import GOAL_RADIUS, JOINTS, SKILLS, goal_distances


def human_demonstrations(episodes: Sequence[Recording]) -> list[list[Segment]]:
    """People's demonstrations, each cut into its skills."""
    return [cut(as_episode(episode)) for episode in episodes]


def as_episode(recording: Recording) -> Episode:
    """What a recording of the kitchen shows."""
    observations = recording.observations
    positions = np.hstack([observations[:, :JOINTS], observations[:, 18:39]])
    distances = [goal_distances(positions, skill) for skill in range(len(SKILLS))]
    return Episode(
        observations=observations.astype(np.float32),
        actions=np.clip(recording.actions, -1, 1).astype(np.float32),  # as the environment does
        achieved=np.stack(distances, axis=1) < GOAL_RADIUS,
        snapshots=np.empty((len(observations), 0)),
        relocating=np.zeros(len(recording), dtype=bool),
    )
