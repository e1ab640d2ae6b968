"""Recordings in an .npz file: how they are read, and what is said of those that are wrong."""

from pathlib import Path

import numpy as np
import pytest

from stitching.data.own.npz import npz_recordings
from stitching.data.transitions import DataError
from stitching.envs.kitchen import KITCHEN


def sound() -> dict[str, np.ndarray]:
    """Two episodes of three actions each."""
    return {
        "observations": np.zeros((8, 59)),
        "actions": np.zeros((6, 9)),
        "episode_ends": np.array([3, 6]),
    }


def with_value(column: str, row: int, value: float) -> dict[str, np.ndarray]:
    columns = sound()
    columns[column][row, 4] = value
    return columns


@pytest.mark.parametrize("last", [True, False], ids=["one-more", "as-many"])
def test_with_or_without_the_last_observation(last: bool, tmp_path: Path) -> None:
    """Each state says which step of which episode it is."""
    seen = [
        np.full((steps + 1, 59), 10.0 * steps) + np.arange(steps + 1)[:, None] for steps in (3, 5)
    ]
    np.savez(
        tmp_path / "mine.npz",
        observations=np.concatenate([each if last else each[:-1] for each in seen]),
        actions=np.arange(8.0)[:, None] + np.zeros(9),
        episode_ends=np.array([3, 8]),
    )
    first, second = npz_recordings(tmp_path / "mine.npz", KITCHEN)
    assert [len(first), len(second)] == ([3, 5] if last else [2, 4])
    assert first.observations[:, 0].tolist() == [30, 31, 32, 33][: len(first) + 1]
    assert second.observations[:, 0].tolist() == [50, 51, 52, 53, 54, 55][: len(second) + 1]
    assert second.actions[:, 0].tolist() == [3, 4, 5, 6, 7][: len(second)]


def test_labels_and_their_absence(tmp_path: Path) -> None:
    labels = {"skills": np.array(["kettle", ""]), "successes": np.array([False, True])}
    np.savez(tmp_path / "mine.npz", **sound(), **labels)
    told = [(each.skill, each.success) for each in npz_recordings(tmp_path / "mine.npz", KITCHEN)]
    assert told == [("kettle", False), ("", True)]
    np.savez(tmp_path / "mine.npz", **sound())
    told = [(each.skill, each.success) for each in npz_recordings(tmp_path / "mine.npz", KITCHEN)]
    assert told == [(None, True), (None, True)]


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"actions": np.zeros((3, 9))}, "has no observations and no episode_ends; .*found actions"),
        (sound() | {"episode_ends": np.array([2, 5])}, "episode_ends, row 1: 5, with 6 actions"),
        (sound() | {"episode_ends": np.array([3, 7])}, "episode_ends, row 1: 7, with 6 actions"),
        (sound() | {"episode_ends": np.array([3, 3])}, "episode_ends, row 1: 3 after 3"),
        (sound() | {"episode_ends": np.array([4, 3, 6])}, "episode_ends, row 1: 3 after 4"),
        (sound() | {"episode_ends": np.array([0, 6])}, "episode_ends, row 0: 0 after 0"),
        (sound() | {"episode_ends": np.array([], dtype=int)}, "episode_ends is empty"),
        (sound() | {"episode_ends": np.array([3.0, 6.0])}, "episode_ends is float64"),
        (sound() | {"episode_ends": np.array(6)}, r"episode_ends is int64 of shape \(\)"),
        (sound() | {"observations": np.zeros((8, 60))}, r"shape \(8, 60\); expected .*\(N, 59\)"),
        (sound() | {"actions": np.zeros((6, 9), dtype=int)}, "actions is int64"),
        (sound() | {"observations": np.zeros((5, 59))}, "5 observations for 6 actions"),
        (
            sound() | {"observations": np.zeros((6, 59)), "episode_ends": np.array([1, 6])},
            "episode_ends, row 0: an episode of one action and one observation",
        ),
        (with_value("observations", 5, np.nan), "observations, row 5: not a finite number"),
        (with_value("observations", 5, 1e39), "observations, row 5: not a finite number"),
        (with_value("actions", 2, np.inf), "actions, row 2: not a finite number"),
        (sound() | {"actions": np.array([{}] * 6)}, "cannot be read as an .npz file"),
        (sound() | {"skills": np.array([1, 2])}, "skills is int64 .* expected skills of strings"),
        (sound() | {"skills": np.array(["kettle"])}, "1 skills for 2 episodes; expected one each"),
        (sound() | {"successes": np.array([1, 0])}, "expected successes of booleans"),
        (sound() | {"successes": np.ones(6, dtype=bool)}, "6 successes for 2 episodes"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(
    columns: dict[str, np.ndarray], told: str, tmp_path: Path
) -> None:
    np.savez(tmp_path / "mine.npz", **columns)
    with pytest.raises(DataError, match=rf"mine\.npz: .*{told}"):
        npz_recordings(tmp_path / "mine.npz", KITCHEN)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"\x93NUMPY", b"text"])
def test_a_file_that_is_no_archive_is_said(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "mine.npz").write_bytes(content)
    with pytest.raises(DataError, match=r"mine\.npz: cannot be read as an .npz file"):
        npz_recordings(tmp_path / "mine.npz", KITCHEN)
    np.save(tmp_path / "one.npy", np.zeros(3))
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    with pytest.raises(DataError, match=r"one\.npz: one array"):
        npz_recordings(tmp_path / "one.npz", KITCHEN)
