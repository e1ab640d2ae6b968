"""Recorded episodes one after the other in the arrays of an .npz file."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from stitching.data.own.recording import Recording, first_not_finite
from stitching.data.transitions import DataError
from stitching.envs.protocol import Benchmark

WORDS: dict[type, str] = {
    np.floating: "floats",
    np.integer: "integers",
    np.str_: "strings",
    np.bool_: "booleans",
}


@dataclass(frozen=True)
class Column:
    """What an array must be: its kind of values, and its width; 0 for one value a row."""

    kind: type
    width: int = 0
    needed: bool = True

    def __str__(self) -> str:
        return f"{WORDS[self.kind]}, (N,{f' {self.width}' if self.width else ''})"

    def fits(self, array: np.ndarray) -> bool:
        if not array.ndim or not np.issubdtype(array.dtype, self.kind):
            return False
        return array.shape == ((len(array), self.width) if self.width else (len(array),))


def npz_recordings(path: Path, benchmark: Benchmark) -> list[Recording]:
    """Arrays observations (N, observation), actions (M, action), episode_ends (E,).

    Ends count actions: each is one past an episode's last row of actions. There is one more
    observation than actions in every episode (N = M + E), or as many (N = M): then an episode's
    last action, whose result is unknown, is dropped. Beside these there may be skills (E,), a name
    an episode, and successes (E,), whether its last action achieves it; without these, it does.

    Raises DataError naming the array, the row and what was expected.
    """
    arrays = _arrays(
        path,
        {
            "observations": Column(np.floating, benchmark.observation_size),
            "actions": Column(np.floating, benchmark.actions.size),
            "episode_ends": Column(np.integer),
            "skills": Column(np.str_, needed=False),
            "successes": Column(np.bool_, needed=False),
        },
    )
    observations, actions, ends = (arrays[n] for n in ("observations", "actions", "episode_ends"))
    _check_ends(path, ends, len(actions))
    for name in arrays.keys() & {"skills", "successes"}:
        if len(arrays[name]) != len(ends):
            raise DataError(
                f"{path}: {len(arrays[name])} {name} for {len(ends)} episodes; expected one each"
            )
    extra = (len(observations) - len(actions)) // len(ends)
    if len(observations) != len(actions) + extra * len(ends) or extra not in (0, 1):
        raise DataError(
            f"{path}: {len(observations)} observations for {len(actions)} actions in {len(ends)} "
            "episodes; expected as many, or one more an episode"
        )
    if not extra and (short := np.flatnonzero(np.diff(ends, prepend=0) < 2)).size:
        row = int(short[0])
        raise DataError(
            f"{path}: episode_ends, row {row}: an episode of one action and one observation; "
            "expected two at least, for what came of the last action is unknown"
        )
    splits = ends[:-1]
    names = arrays["skills"].tolist() if "skills" in arrays else [None] * len(ends)
    outcomes = arrays["successes"].tolist() if "successes" in arrays else [True] * len(ends)
    return [
        Recording(seen, acted[: len(seen) - 1], name, success)
        for seen, acted, name, success in zip(
            np.split(observations, splits + extra * np.arange(1, len(ends))),
            np.split(actions, splits),
            names,
            outcomes,
            strict=True,
        )
    ]


def _arrays(path: Path, columns: dict[str, Column]) -> dict[str, np.ndarray]:
    """The arrays of these names, each with the shape and the kind of values that it must have."""
    needed = [name for name, column in columns.items() if column.needed]
    try:
        loaded = np.load(path, allow_pickle=False)
        if not isinstance(loaded, np.lib.npyio.NpzFile):
            raise DataError(f"{path}: one array; expected an .npz file with several")
        with loaded as file:
            if missing := [name for name in needed if name not in file]:
                raise DataError(
                    f"{path}: has no {' and no '.join(missing)}; expected {', '.join(needed)}, "
                    f"found {', '.join(file) or 'nothing'}"
                )
            arrays = {name: file[name] for name in columns if name in file}
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"{path}: cannot be read as an .npz file: {error}") from error
    for name, array in arrays.items():
        if not (column := columns[name]).fits(array):
            raise DataError(
                f"{path}: {name} is {array.dtype} of shape {array.shape}; "
                f"expected {name} of {column}"
            )
        if column.kind is np.floating and (row := first_not_finite(array)) is not None:
            raise DataError(f"{path}: {name}, row {row}: not a finite number")
    return arrays


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
