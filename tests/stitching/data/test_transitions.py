"""Datasets on disk: what is written comes back, and what must not be trained on is refused."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from stitching.data.transitions import (
    NO_SKILL,
    DataError,
    Transitions,
    check,
    concatenate,
)
from stitching.envs.maze import MAZE

OBSERVATION, ACTION, SKILLS = MAZE.observation_size, MAZE.actions.size, len(MAZE.skills)


def dataset(lengths: tuple[int, ...] = (3, 1, 4), seed: int = 0) -> Transitions:
    rng = np.random.default_rng(seed)
    rows = sum(lengths)
    skills = np.arange(len(lengths)) % (SKILLS + 1) - 1  # NO_SKILL among them
    return Transitions(
        observations=rng.random((rows, OBSERVATION), dtype=np.float32),
        actions=MAZE.actions.uniform(rng, (rows,)),
        next_observations=rng.random((rows, OBSERVATION), dtype=np.float32),
        episode_ends=np.cumsum(lengths),
        episode_skills=skills,
        episode_successes=skills != NO_SKILL,
    )


def assert_same_bytes(actual: Transitions, expected: Transitions) -> None:
    for name, column in expected.columns().items():
        other = actual.columns()[name]
        assert (other.dtype, other.shape) == (column.dtype, column.shape), name
        assert other.tobytes() == column.tobytes(), name


def test_episodes_know_their_rows() -> None:
    data = dataset((3, 1, 4, 2, 5, 1, 2))  # skills −1, 0, 1, 2, 3, −1, 0
    assert len(data) == 18
    assert data.episode_starts.tolist() == [0, 3, 4, 8, 10, 15, 16]
    assert [rows.tolist() for rows in data.episode_rows(0)] == [[3], [16, 17]]
    assert [rows.tolist() for rows in data.episode_rows(3)] == [[10, 11, 12, 13, 14]]
    assert data.episode_rows(4) == []
    covered = [rows for skill in range(NO_SKILL, SKILLS) for rows in data.episode_rows(skill)]
    assert sorted(np.concatenate(covered)) == list(range(18))


def test_a_union_holds_every_episode_in_order() -> None:
    parts = [dataset((3, 1), 0), dataset((2,), 1), dataset((5, 4, 1), 2)]
    union = concatenate(parts)
    check(union, MAZE, "union")
    assert len(union.episode_ends) == 6
    starts, ends = iter(union.episode_starts), iter(union.episode_ends)
    episode = 0
    for part in parts:
        for own_start, own_end in zip(part.episode_starts, part.episode_ends, strict=True):
            rows, own = slice(next(starts), next(ends)), slice(own_start, own_end)
            for column in ("observations", "actions", "next_observations"):
                there, here = union.columns()[column][rows], part.columns()[column][own]
                assert np.array_equal(there, here)
            episode += 1
    skills = np.concatenate([part.episode_skills for part in parts])
    assert np.array_equal(union.episode_skills, skills)


def test_a_union_of_one_is_itself() -> None:
    assert_same_bytes(concatenate([dataset()]), dataset())


def changed(column: str, index: object, value: object) -> Transitions:
    data = dataset()
    data.columns()[column][index] = value
    return data


def resized(column: str, change: Callable[[np.ndarray], np.ndarray]) -> Transitions:
    data = dataset()
    return replace(data, **{column: change(data.columns()[column])})


# What is wrong → the dataset (episodes of 3, 1 and 4 rows), its file, and what else is said.
BAD = {
    "NaN": (changed("observations", (5, 2), np.nan), "observations", "row 5"),
    "NaN at the end": (changed("next_observations", (7, 0), np.nan), "next_observations", "row 7"),
    "infinity": (changed("next_observations", (2, 1), -np.inf), "next_observations", "row 2"),
    "NaN action": (changed("actions", (6, 3), np.nan), "actions", "row 6"),
    "action above 1": (changed("actions", (4, 1), 1.5), "actions", "row 4"),
    "action below -1": (changed("actions", (3, 0), -1.01), "actions", "row 3"),
    "first of two bad rows": (changed("actions", [4, 6], 2), "actions", "row 4"),
    "narrow observations": (
        resized("observations", lambda c: c[:, :-1]),
        "observations",
        r"shape \(8, 5\), expected \(8, 6\)",
    ),
    "flat observations": (resized("observations", np.ravel), "observations", r"shape \(48,\)"),
    "wide actions": (
        resized("actions", lambda c: np.pad(c, ((0, 0), (0, 1)))),
        "actions",
        r"shape \(8, 5\), expected \(8, 4\)",
    ),
    "too few observations": (
        resized("observations", lambda c: c[:-1]),
        "observations",
        r"shape \(7, 6\), expected \(8, 6\)",
    ),
    "too many next observations": (
        resized("next_observations", lambda c: np.concatenate([c, c[:1]])),
        "next_observations",
        r"shape \(9, 6\), expected \(8, 6\)",
    ),
    "a skill too few": (
        resized("episode_skills", lambda c: c[:-1]),
        "episode_skills",
        r"shape \(2,\), expected \(3,\)",
    ),
    "a success too many": (
        resized("episode_successes", lambda c: np.append(c, True)),
        "episode_successes",
        r"shape \(4,\), expected \(3,\)",
    ),
    "an empty episode": (changed("episode_ends", 1, 3), "episode_ends", "row 1"),
    "an empty first episode": (changed("episode_ends", 0, 0), "episode_ends", "row 0"),
    "ends that fall": (changed("episode_ends", 1, 2), "episode_ends", "row 1"),
    "a negative end": (changed("episode_ends", 0, -3), "episode_ends", "row 0"),
    "an end past the data": (changed("episode_ends", 2, 9), "episode_ends", "8"),
    "rows of no episode": (changed("episode_ends", 2, 7), "episode_ends", "8"),
    "an unknown skill": (
        changed("episode_skills", 2, SKILLS),
        "episode_skills",
        f"row 2 names skill {SKILLS}",
    ),
    "a skill below none": (
        changed("episode_skills", 1, NO_SKILL - 1),
        "episode_skills",
        "row 1 names skill -2",
    ),
}


@pytest.mark.parametrize(("data", "file", "detail"), BAD.values(), ids=BAD)
def test_bad_data_is_refused_naming_file_and_place(
    data: Transitions, file: str, detail: str
) -> None:
    with pytest.raises(DataError, match=rf"^some/folder/{file}\.npy: .*{detail}"):
        check(data, MAZE, "some/folder")


def test_good_data_passes() -> None:
    check(dataset(), MAZE, "good")
    check(changed("episode_skills", 0, NO_SKILL), MAZE, "without a skill")


@pytest.mark.parametrize("end", [7, 9])
def test_a_last_end_that_misses_the_data_is_named(end: int) -> None:
    with pytest.raises(DataError, match="row 2"):
        check(changed("episode_ends", 2, end), MAZE, "data")


def test_a_dataset_of_nothing_is_refused() -> None:
    empty = Transitions(**{name: column[:0] for name, column in dataset().columns().items()})
    with pytest.raises(DataError, match="data"):
        check(empty, MAZE, "data")


@pytest.mark.parametrize(
    ("column", "dtype"),
    [
        ("observations", np.float64),
        ("actions", np.float64),
        ("next_observations", np.int64),
        ("episode_ends", np.float64),
        ("episode_skills", np.float32),
        ("episode_successes", np.float32),
    ],
)
def test_columns_of_another_type_are_refused(column: str, dtype: type) -> None:
    data = resized(column, lambda c: c.astype(dtype))
    with pytest.raises(DataError, match=rf"{column}\.npy"):
        check(data, MAZE, "data")


def test_columns_of_text_are_refused() -> None:
    with pytest.raises(DataError, match=r"observations\.npy"):
        check(resized("observations", lambda c: c.astype(str)), MAZE, "data")


@pytest.mark.parametrize("action", [(0, 0, 0, 0), (1, 1, 0, 0), (0.5, 0.5, 0, 0), (-1, 0, 0, 0)])
def test_discrete_actions_must_be_one_hot(action: tuple[float, ...]) -> None:
    with pytest.raises(DataError, match=r"actions\.npy: row 4"):
        check(changed("actions", 4, action), MAZE, "data")
