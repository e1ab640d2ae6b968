"""Human demonstrations of the kitchen, `D4RL/kitchen/*` of Minari, cut into skills.

Which skill an episode shows, and where it ends, is read off the observed objects, never off the
dataset's name or its infos: Minari's descriptions of `partial` and `mixed` are swapped.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from stitching.data.kitchen.segments import Episode, Segment, cut
from stitching.data.transitions import DataError
from stitching.envs.kitchen import GOAL_RADIUS, JOINTS, KITCHEN, SKILLS, goal_distances

Recording = tuple[np.ndarray, np.ndarray]  # observations (T + 1, 59), actions (T, 9)

COLUMNS: dict[str, tuple[type[np.number[Any]], int]] = {
    "observations": (np.floating, 59),
    "actions": (np.floating, 9),
    "episode_ends": (np.integer, 0),
}
"""Arrays of an .npz file: kind of number, and width; 0 for one number a row."""


def human_demonstrations(source: str) -> list[list[Segment]]:
    """People's demonstrations, each cut into its skills, from an .npz file or a Minari dataset.

    Raises DataError where it is not there, or does not fit.
    """
    episodes = []
    for number, recording in enumerate(_recordings(source)):
        try:
            episodes.append(cut(as_episode(*recording)))
        except DataError as error:
            raise DataError(f"{source}, episode {number}: {error}") from error
    return episodes


def recordings_at(source: str) -> Path:
    """The file, or the folder of the Minari dataset, which need not be there."""
    if source.endswith(".npz"):
        return Path(source)
    usual = Path.home() / ".minari" / "datasets"
    return Path(os.environ.get("MINARI_DATASETS_PATH") or usual) / source


def _recordings(source: str) -> list[Recording]:
    place = recordings_at(source)
    if not place.exists():
        raise DataError(f"nothing at {place}: data.human names an .npz file or a Minari dataset")
    if source.endswith(".npz"):
        return npz_recordings(place)
    try:
        import minari  # its import is slow, and only this data needs it

        return minari_recordings(minari.load_dataset(source))
    except ModuleNotFoundError as error:
        raise DataError(
            f"{error.name} is not installed, which reads Minari datasets: "
            "install skillstitch with its extra `human`, as in `pip install -e '.[human]'`"
        ) from error
    except (ValueError, KeyError, OSError, TypeError) as error:
        raise DataError(f"{place}: cannot be read as a Minari dataset: {error}") from error


def minari_recordings(dataset: Iterable[Any]) -> list[Recording]:
    """The episodes of a loaded `minari.MinariDataset`.

    One without its last observation loses its last action, whose result is unknown.
    """
    recordings = []
    for episode in dataset:
        seen = np.asarray(episode.observations["observation"])
        acted = np.asarray(episode.actions)
        recordings.append((seen, acted[:-1] if len(seen) == len(acted) else acted))
    return recordings


def npz_recordings(path: Path) -> list[Recording]:
    """Episodes one after the other: observations (N, 59), actions (M, 9), episode_ends (E,).

    Ends count actions: each is one past an episode's last row of actions. There is one more
    observation than actions in every episode (N = M + E), or as many (N = M): then an episode's
    last action, whose result is unknown, is dropped.

    Raises DataError naming the key, the row and what was expected.
    """
    observations, actions, ends = _columns(path)
    _check_ends(path, ends, len(actions))
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


def _columns(path: Path) -> list[np.ndarray]:
    """The arrays of COLUMNS, each with the shape and the kind of numbers that it must have."""
    try:
        loaded = np.load(path, allow_pickle=False)
        if not isinstance(loaded, np.lib.npyio.NpzFile):
            raise DataError(f"{path}: one array; expected an .npz file with several")
        with loaded as file:
            if missing := [name for name in COLUMNS if name not in file]:
                raise DataError(
                    f"{path}: has no {' and no '.join(missing)}; expected {', '.join(COLUMNS)}, "
                    f"found {', '.join(file) or 'nothing'}"
                )
            columns = [file[name] for name in COLUMNS]
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{path}: cannot be read as an .npz file: {error}") from error
    for (name, (kind, width)), column in zip(COLUMNS.items(), columns, strict=True):
        expected = f"{name} of {kind.__name__}s, (N,{f' {width}' if width else ''})"
        shape = (len(column), width) if width and column.ndim else column.shape[:1]
        if not np.issubdtype(column.dtype, kind) or column.shape != shape or not len(shape):
            raise DataError(
                f"{path}: {name} is {column.dtype} of shape {column.shape}; expected {expected}"
            )
        if kind is np.floating and not (finite := np.isfinite(column).all(axis=1)).all():
            raise DataError(f"{path}: {name}, row {int(finite.argmin())}: not a finite number")
    return columns


def _check_ends(path: Path, ends: np.ndarray, actions: int) -> None:
    """Whether they cut the actions into episodes of at least one."""
    if not len(ends):
        raise DataError(f"{path}: episode_ends is empty; expected one number an episode")
    starts = np.r_[0, ends[:-1]]
    if (short := np.flatnonzero(ends <= starts)).size:
        row = int(short[0])
        raise DataError(
            f"{path}: episode_ends, row {row}: {ends[row]} after {starts[row]}; expected numbers "
            "that rise, each one past its episode's last action"
        )
    if ends[-1] != actions:
        raise DataError(
            f"{path}: episode_ends, row {len(ends) - 1}: {ends[-1]}, with {actions} actions; "
            f"expected {actions}, for an end is one past its episode's last action"
        )


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
