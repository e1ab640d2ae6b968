"""What learners sample from, against the definitions written out transition by transition."""

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stitching.data.experience import Experience, skill_experience
from stitching.data.transitions import NO_SKILL, DataError, Transitions

SKILLS = 3
CONDITIONS = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], dtype=np.float32)

episode = st.tuples(st.integers(1, 6), st.integers(NO_SKILL, SKILLS - 1), st.booleans())


def dataset(episodes: list[tuple[int, int, bool]]) -> Transitions:
    """Episodes of (length, skill, success); the observation tells the row."""
    lengths, skills, successes = zip(*episodes, strict=True)
    column = np.arange(sum(lengths), dtype=np.float32)[:, None]
    return Transitions(
        observations=column,
        actions=np.ones_like(column),
        next_observations=column + 1,
        episode_ends=np.cumsum(lengths),
        episode_skills=np.array(skills),
        episode_successes=np.array(successes),
    )


def spans(data: Transitions) -> list[tuple[int, int]]:
    return list(pairwise([0, *data.episode_ends.tolist()]))


Row = tuple[int, tuple[float, ...], float, bool]  # row, condition, reward, terminal


def listed(experience: Experience) -> list[Row]:
    conditions = experience.conditions[experience.condition_ids].tolist()
    return [
        (int(row), tuple(condition), float(reward), bool(terminal))
        for row, condition, reward, terminal in zip(
            experience.rows, conditions, experience.rewards, experience.terminals, strict=True
        )
    ]


def skill_rows(data: Transitions) -> list[Row]:
    """Every demonstrated row under its skill; 1 and the end where the skill is achieved."""
    rows = []
    for number, (start, end) in enumerate(spans(data)):
        skill = data.episode_skills[number]
        for row in range(start, end):
            if skill != NO_SKILL:
                achieves = bool(row == end - 1 and data.episode_successes[number])
                rows.append((row, tuple(CONDITIONS[skill].tolist()), float(achieves), achieves))
    return rows


@given(st.lists(episode, min_size=1, max_size=8))
def test_skill_experience(episodes: list[tuple[int, int, bool]]) -> None:
    data = dataset(episodes)
    if expected := skill_rows(data):
        assert sorted(listed(skill_experience(data, CONDITIONS))) == sorted(expected)
    else:
        with pytest.raises(DataError, match="no skill"):
            skill_experience(data, CONDITIONS)


def check_types(experience: Experience) -> None:
    dtypes = {
        "rows": np.int64,
        "condition_ids": np.int64,
        "conditions": np.float32,
        "rewards": np.float32,
        "terminals": np.bool_,
    }
    assert set(dtypes) == {field.name for field in fields(Experience)} - {"data"}
    for name, dtype in dtypes.items():
        assert getattr(experience, name).dtype == dtype, name


def test_types_are_those_declared() -> None:
    data = dataset([(5, 0, True), (4, 1, False), (3, 2, True)])
    check_types(skill_experience(data, CONDITIONS))


def test_the_data_are_referred_to_not_copied() -> None:
    data = dataset([(4, 0, True), (4, 1, True)])
    assert skill_experience(data, CONDITIONS).data is data
