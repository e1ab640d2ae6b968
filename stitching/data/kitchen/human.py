"""Human demonstrations of the kitchen, `D4RL/kitchen/*` of Minari, cut into skills.

Which skill an episode shows, and where it ends, is read off the observed objects, never off the
dataset's name or its infos: Minari's descriptions of `partial` and `mixed` are swapped.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from stitching.data.kitchen.segments import Episode, Segment, cut
from stitching.data.transitions import DataError
from stitching.envs.kitchen import GOAL_RADIUS, JOINTS, KITCHEN, SKILLS, goal_distances

Recording = tuple[np.ndarray, np.ndarray]  # observations (T + 1, 59), actions (T, 9)


def human_demonstrations(source: str) -> list[list[Segment]]:
    """People's demonstrations, each cut into its skills, from an .npz file or a Minari dataset.

    A Minari id is looked for in MINARI_DATASETS_PATH first and downloaded if it is not there.
    Raises DataError where neither works.
    """
    return [cut(as_episode(*recording)) for recording in _recordings(source)]


def _recordings(source: str) -> list[Recording]:
    if source.endswith(".npz"):
        if not Path(source).is_file():
            raise DataError(f"no file {source}: data.human names an .npz file or a Minari dataset")
        return npz_recordings(Path(source))
    import minari  # its import is slow, and only this data needs it

    try:
        return minari_recordings(minari.load_dataset(source, download=True))
    except Exception as error:  # from the hub's client: whatever its network layer raises
        raise DataError(
            f"no Minari dataset {source!r}, neither in MINARI_DATASETS_PATH nor on its hub: {error}"
        ) from error


def minari_recordings(dataset: Iterable[Any]) -> list[Recording]:
    """The episodes of a loaded `minari.MinariDataset`."""
    return [(episode.observations["observation"], episode.actions) for episode in dataset]


def npz_recordings(path: Path) -> list[Recording]:
    """Episodes one after the other: observations (N, 59), actions (M, 9), episode_ends (E,).

    Ends count actions. There is one more observation than actions in every episode (N = M + E),
    or as many (N = M): then an episode's last action, whose result is unknown, is dropped.
    """
    with np.load(path, allow_pickle=False) as file:
        observations, actions, ends = (file[n] for n in ("observations", "actions", "episode_ends"))
    extra = (len(observations) - len(actions)) // len(ends)
    if len(observations) != len(actions) + extra * len(ends) or extra not in (0, 1):
        raise DataError(
            f"{path}: {len(observations)} observations for {len(actions)} actions in {len(ends)} "
            "episodes; expected as many, or one more an episode"
        )
    splits = ends[:-1]
    return [
        (seen, acted[: len(seen) - 1])
        for seen, acted in zip(
            np.split(observations, splits + extra * np.arange(1, len(ends))),
            np.split(actions, splits),
            strict=True,
        )
    ]


def as_episode(observations: np.ndarray, actions: np.ndarray) -> Episode:
    """What a recording shows; DataError where it does not fit the kitchen."""
    if observations.shape != (len(actions) + 1, KITCHEN.observation_size):
        raise DataError(f"observations {observations.shape} for actions {actions.shape}")
    positions = np.hstack([observations[:, :JOINTS], observations[:, 18:39]])
    distances = [goal_distances(positions, skill) for skill in range(len(SKILLS))]
    return Episode(
        observations=observations.astype(np.float32),
        actions=np.clip(actions, -1, 1).astype(np.float32),  # as the environment does
        achieved=np.stack(distances, axis=1) < GOAL_RADIUS,
        snapshots=np.empty((len(observations), 0)),
        relocating=np.zeros(len(actions), dtype=bool),
    )
