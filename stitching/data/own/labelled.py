"""A dataset of recorded episodes of which each shows one skill, or none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stitching.data.own.recording import Recording
from stitching.data.transitions import NO_SKILL, DataError, Transitions
from stitching.envs.protocol import ActionSpace, Benchmark


def are_labelled(episodes: Sequence[Recording]) -> bool:
    """Whether any says what it shows."""
    return any(episode.skill is not None for episode in episodes)


def labelled_data(source: str, episodes: Sequence[Recording], benchmark: Benchmark) -> Transitions:
    """The episodes as they are. Those that show no skill teach the dynamics alone.

    Raises DataError, naming the source and the episode, where a skill is not the benchmark's or
    not said, where an action is none, and where no episode shows a skill.
    """
    numbers = {"": NO_SKILL} | {skill.name: n for n, skill in enumerate(benchmark.skills)}
    for number, episode in enumerate(episodes):
        if episode.skill not in numbers:
            names = ", ".join(skill.name for skill in benchmark.skills)
            told = "no skill is said" if episode.skill is None else f"skill {episode.skill!r}"
            raise DataError(
                f'{source}, episode {number}: {told}; expected one of {names}, or "" where it '
                "shows none"
            )
        _check_actions(f"{source}, episode {number}", episode.actions, benchmark.actions)
    skills = np.array([numbers[episode.skill or ""] for episode in episodes], dtype=np.int64)
    if (skills == NO_SKILL).all():
        raise DataError(f"{source}: no episode shows a skill: nothing to learn one from")
    successes = np.array([episode.success for episode in episodes])
    return Transitions(
        observations=_joined([episode.observations[:-1] for episode in episodes]),
        actions=_joined([episode.actions for episode in episodes]),
        next_observations=_joined([episode.observations[1:] for episode in episodes]),
        episode_ends=np.cumsum([len(episode) for episode in episodes]),
        episode_skills=skills,
        episode_successes=successes & (skills != NO_SKILL),
    )


def _joined(arrays: list[np.ndarray]) -> np.ndarray:
    return np.concatenate(arrays).astype(np.float32)


def _check_actions(where: str, actions: np.ndarray, space: ActionSpace) -> None:
    if space.discrete:
        sound = ((actions == 0) | (actions == 1)).all(axis=1) & (actions.sum(axis=1) == 1)
        expected = "one 1 among zeros"
    else:
        sound = (np.abs(actions) <= 1).all(axis=1)
        expected = "numbers in [-1, 1]"
    if not sound.all():
        row = int(sound.argmin())
        raise DataError(
            f"{where}: actions, row {row} of the episode: {actions[row]}; expected {expected}"
        )
