"""MF-Stitch's mixed data, each reading against its definition written out row by row."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stitching.data.experience import Experience
from stitching.data.mixtures import READINGS, Mixture, mixed_experience, skill_pairs
from stitching.data.transitions import DataError, Transitions
from tests.stitching.data.test_experience import (
    CONDITIONS,
    SKILLS,
    check_types,
    dataset,
    episode,
    spans,
)

Row = tuple[float, float, tuple[float, ...], float, bool]  # from, to, condition, reward, terminal
GAMMA = 0.95
APART: list[Mixture] = ["halves", "next-reward", "next-skill", "fine-tuned"]


def listed(experience: Experience) -> list[Row]:
    data, rows = experience.data, experience.rows
    return [
        (float(before[0]), float(after[0]), tuple(condition), float(reward), bool(terminal))
        for before, after, condition, reward, terminal in zip(
            data.observations[rows],
            data.next_observations[rows],
            experience.conditions[experience.condition_ids].tolist(),
            experience.rewards,
            experience.terminals,
            strict=True,
        )
    ]


def expected(data: Transitions, mixture: Mixture) -> list[Row]:
    """For (i, j): second halves of i, no reward; first halves of j, and what these earn."""
    rows: list[Row] = []
    for i, j in skill_pairs(SKILLS):
        condition = tuple(CONDITIONS[j].tolist())
        if mixture in ("halves", "next-reward"):
            condition = (*CONDITIONS[i].tolist(), *condition)
        for number, (start, end) in enumerate(spans(data)):
            middle = start + (end - start) // 2
            if end - start < 2 or not data.episode_successes[number]:
                continue
            if data.episode_skills[number] == i:
                rows += [(r, r + 1, condition, 0.0, r == end - 1) for r in range(middle, end)]
            if data.episode_skills[number] == j:
                earned = 1.0 if mixture == "halves" else float(np.float32(GAMMA ** (end - middle)))
                for r in range(start, middle):
                    arrives = r == middle - 1
                    rows.append((r, r + 1, condition, earned if arrives else 0.0, arrives))
    return rows


@pytest.mark.parametrize("mixture", APART)
@given(episodes=st.lists(episode, min_size=1, max_size=8))
def test_halves_apart(mixture: Mixture, episodes: list[tuple[int, int, bool]]) -> None:
    data = dataset(episodes)
    if rows := expected(data, mixture):
        experience = mixed_experience(data, CONDITIONS, mixture, GAMMA)
        assert experience.data is data
        assert sorted(listed(experience)) == sorted(rows)
    else:
        with pytest.raises(DataError, match="no skill"):
            mixed_experience(data, CONDITIONS, mixture, GAMMA)


def test_joined_halves_are_one_trajectory() -> None:
    """Two demonstrations of skill 0 and one of skill 1, which serves twice; the missed one never.

    Rows 0–3, 4–6 (its second half is 5, 6) and 7–10; the joints lead to where others begin.
    """
    data = dataset([(4, 0, True), (3, 0, True), (4, 1, True), (6, 1, False)])
    there, back = ((*CONDITIONS[i].tolist(), *CONDITIONS[1 - i].tolist()) for i in (0, 1))
    assert listed(mixed_experience(data, CONDITIONS[:2], "joined", GAMMA)) == [
        (2, 3, there, 0, False),
        (3, 7, there, 0, False),
        (7, 8, there, 0, False),
        (8, 9, there, 1, True),
        (5, 6, there, 0, False),
        (6, 7, there, 0, False),
        (7, 8, there, 0, False),
        (8, 9, there, 1, True),
        (9, 10, back, 0, False),
        (10, 0, back, 0, False),
        (0, 1, back, 0, False),
        (1, 2, back, 1, True),
        (9, 10, back, 0, False),
        (10, 4, back, 0, False),
        (4, 5, back, 1, True),
    ]


def test_skills_that_nobody_shows_are_joined_to_none() -> None:
    data = dataset([(4, 0, True), (4, 1, True)])
    joined = mixed_experience(data, CONDITIONS, "joined", GAMMA)
    assert {skill_pairs(SKILLS)[pair] for pair in joined.condition_ids} == {(0, 1), (1, 0)}
    with pytest.raises(DataError, match="no skill"):
        mixed_experience(dataset([(4, 0, True)]), CONDITIONS, "joined", GAMMA)


@pytest.mark.parametrize("mixture", sorted(READINGS))
def test_types_are_those_declared(mixture: Mixture) -> None:
    data = dataset([(5, 0, True), (4, 1, False), (3, 2, True)])
    experience = mixed_experience(data, CONDITIONS, mixture, GAMMA)
    check_types(experience)
    for name, column in experience.data.columns().items():
        assert column.dtype == data.columns()[name].dtype, name


@pytest.mark.parametrize("mixture", sorted(READINGS))
def test_a_single_skill_follows_itself(mixture: Mixture) -> None:
    """The missed episode is no example of either half."""
    data = dataset([(4, 0, True), (4, 0, False)])
    experience = mixed_experience(data, CONDITIONS[:1], mixture, GAMMA)
    assert skill_pairs(1) == [(0, 0)]
    assert len(experience.conditions) == 1
    assert sorted(row for row, *_ in listed(experience)) == [0, 1, 2, 3]


def test_pairs_are_ordered_and_of_two_skills() -> None:
    pairs = [(i, j) for i in range(SKILLS) for j in range(SKILLS) if i != j]
    assert sorted(skill_pairs(SKILLS)) == pairs
