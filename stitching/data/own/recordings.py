"""Recorded episodes from an .npz file or a Minari dataset, checked before anything is learned."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stitching.data.own.npz import npz_recordings
from stitching.data.own.recording import Recording, first_not_finite
from stitching.data.transitions import DataError
from stitching.envs.protocol import Benchmark

METADATA = Path("data", "metadata.json")  # within the folder of a Minari dataset


def recordings_at(source: str) -> Path:
    """The file, or the folder of the Minari dataset, which need not be there."""
    if source.endswith(".npz"):
        return Path(source)
    usual = Path.home() / ".minari" / "datasets"
    return Path(os.environ.get("MINARI_DATASETS_PATH") or usual) / source


def is_minari_dataset(folder: Path) -> bool:
    """Whether it is the folder of one, as far as its files' names tell."""
    return (folder / METADATA).is_file()


def recordings(source: str, benchmark: Benchmark) -> list[Recording]:
    """Every episode of an .npz file or, by its id, of a Minari dataset.

    Raises DataError where it is not there, or does not fit the benchmark.
    """
    place = recordings_at(source)
    if source.endswith(".npz"):
        if not place.is_file():
            raise DataError(f"no file {place}")
        return npz_recordings(place, benchmark)
    if not is_minari_dataset(place):
        raise DataError(f"no Minari dataset at {place}: it has no {METADATA}")
    try:
        import minari  # its import is slow, and only this data needs it

        episodes = list(minari_recordings(minari.load_dataset(source)))
    except ModuleNotFoundError as error:
        raise DataError(
            f"{error.name} is not installed, which reads Minari datasets: "
            "install skillstitch with its extra `human`, as in `pip install -e '.[human]'`"
        ) from error
    except (ValueError, KeyError, OSError, TypeError, AttributeError, AssertionError) as error:
        why = f"{type(error).__name__} {error}".strip()
        raise DataError(f"{place}: cannot be read as a Minari dataset: {why}") from error
    if not episodes:
        raise DataError(f"{place}: holds no episode")
    for number, episode in enumerate(episodes):
        _check(f"{place}, episode {number}", episode, benchmark)
    return episodes


def minari_recordings(dataset: Any) -> Iterator[Recording]:
    """The episodes of a loaded `minari.MinariDataset`.

    Observations are arrays, or dicts that have one as "observation". An episode without its last
    observation loses its last action, whose result is unknown. An episode's options may hold its
    "skill" and whether it was "accomplished", as `skillstitch export` writes them.
    """
    for episode in dataset.iterate_episodes():
        seen = episode.observations
        seen = np.asarray(seen["observation"] if isinstance(seen, dict) else seen)
        acted = np.asarray(episode.actions)
        (metadata,) = dataset.storage.get_episode_metadata([episode.id])
        options = metadata.get("options") or {}
        skill = options.get("skill")
        yield Recording(
            seen,
            acted[:-1] if len(seen) == len(acted) else acted,
            None if skill is None else str(skill),
            bool(options.get("accomplished", True)),
        )


def _check(where: str, episode: Recording, benchmark: Benchmark) -> None:
    """What the columns of an .npz file are checked for at once."""
    for name, array, shape in (
        ("actions", episode.actions, (len(episode), benchmark.actions.size)),
        ("observations", episode.observations, (len(episode) + 1, benchmark.observation_size)),
    ):
        if array.shape != shape or not np.issubdtype(array.dtype, np.floating):
            raise DataError(
                f"{where}: {name} is {array.dtype} of shape {array.shape}; expected floats, {shape}"
            )
        if (row := first_not_finite(array)) is not None:
            raise DataError(f"{where}: {name}, row {row}: not a finite number")
    if not len(episode):
        raise DataError(f"{where}: no action whose result is known; expected at least one")
