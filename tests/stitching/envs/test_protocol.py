"""What all benchmarks share: action spaces, and skills by name."""

import numpy as np
import pytest

from stitching.envs.maze import MAZE
from stitching.envs.protocol import ActionSpace, conditions, skill_index

MOVES, ARM = ActionSpace(4, discrete=True), ActionSpace(3, discrete=False)


@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
@pytest.mark.parametrize("space", [MOVES, ARM], ids=["discrete", "continuous"])
def test_uniform_actions_have_the_shape_asked_for(
    space: ActionSpace, shape: tuple[int, ...]
) -> None:
    actions = space.uniform(np.random.default_rng(0), shape)
    assert actions.shape == (*shape, space.size)
    assert actions.dtype == np.float32


def test_discrete_actions_are_one_hot_and_equally_likely() -> None:
    actions = MOVES.uniform(np.random.default_rng(0), (4000,))
    assert set(np.unique(actions)) == {0, 1}
    assert (actions.sum(axis=1) == 1).all()
    np.testing.assert_allclose(actions.mean(axis=0), 0.25, atol=0.03)


def test_continuous_actions_fill_the_box_evenly() -> None:
    actions = ARM.uniform(np.random.default_rng(0), (4000,))
    assert np.abs(actions).max() <= 1
    quantiles = np.quantile(actions, [0.25, 0.5, 0.75], axis=0)
    np.testing.assert_allclose(quantiles, np.array([[-0.5, 0, 0.5]] * 3).T, atol=0.06)


def test_skills_are_found_by_name() -> None:
    assert [skill_index(MAZE, skill.name) for skill in MAZE.skills] == [0, 1, 2, 3]


def test_an_unknown_skill_is_answered_with_those_there_are() -> None:
    names = ", ".join(skill.name for skill in MAZE.skills)
    with pytest.raises(ValueError, match=f"maze has no skill 'nowhere'; it has {names}"):
        skill_index(MAZE, "nowhere")


def test_conditions_are_the_skills_own_in_their_order() -> None:
    stacked = conditions(MAZE)
    assert stacked.dtype == np.float32
    for skill, row in zip(MAZE.skills, stacked, strict=True):
        np.testing.assert_array_equal(row, np.array(skill.condition, dtype=np.float32))
