"""The self test: does this machine train the same bytes twice?"""

from __future__ import annotations

import time

from orchestrator.doctor.finding import Finding


def check_training() -> Finding:
    """Train a tiny agent of the maze twice: the bytes must agree."""
    start = time.monotonic()
    try:
        first, second = train_tiny_agent(), train_tiny_agent()
    except FloatingPointError as error:
        advice = "install the pinned torch again; if it stays, this CPU or its drivers are at fault"
        return Finding("self test", "fault", str(error), advice)
    return judge_determinism(first, second, time.monotonic() - start)


def train_tiny_agent() -> dict[str, bytes]:
    """Weights by name; raises FloatingPointError if a loss is not finite."""
    import numpy as np

    from stitching.data.experience import skill_experience
    from stitching.data.maze import MazeDataConfig, skill_demonstrations
    from stitching.envs.maze import MAZE
    from stitching.models.iql import IQLConfig, train_iql

    data = skill_demonstrations(MAZE, MazeDataConfig(episodes=3), 0)
    conditions = np.array([skill.condition for skill in MAZE.skills], dtype=np.float32)
    config = IQLConfig(updates=20, batch_size=32, members=2, width=16, log_every=5)
    trained = train_iql(skill_experience(data, conditions), MAZE.actions, config, "doctor")
    return {name: weight.tobytes() for name, weight in trained.weights.items()}


def judge_determinism(first: object, second: object, seconds: float) -> Finding:
    """Whether two trainings of the same gave the same."""
    if first == second:
        return Finding("self test", "ok", f"two trainings gave the same bytes ({seconds:.1f} s)")
    advice = "set OMP_NUM_THREADS=1 and install the pinned torch; until then runs do not repeat"
    return Finding("self test", "fault", "two trainings gave different bytes", advice)
