"""What follows single episodes through a rollout, for pictures and films."""

from __future__ import annotations

from typing import Any, Protocol

from stitching.envs.first_times import FirstTimes
from stitching.envs.protocol import VectorEnv
from stitching.rollout import Recorder


class EpisodeRecorder(Recorder, Protocol):
    """Is told of every step of every episode, and tells of one."""

    def scene(self) -> dict[str, Any]:
        """What all episodes have in common, as JSON; "kind" says how they are drawn."""

    def episode(self, number: int) -> dict[str, Any]:
        """What was recorded of an episode, step by step, as JSON."""


def simulated(env: VectorEnv) -> VectorEnv:
    """The benchmark's own environment: what counts first achievements adds to its snapshots."""
    return env.inner if isinstance(env, FirstTimes) else env
