"""How actions move the robot, found in demonstrations; and when it touches what they are about."""

import numpy as np
import pytest

from stitching.data.robot import RobotModel, before_contact
from stitching.data.transitions import concatenate
from tests.stitching.data.made_up import (
    DATA,
    EFFECT,
    FACTORS,
    SAG,
    SKILLS,
    STEPS,
    TOUCHED,
    made_up,
)  # fmt: skip


def test_the_law_is_found() -> None:
    model = RobotModel.of(DATA, before_contact(DATA, FACTORS, SKILLS), FACTORS)
    assert model.columns.tolist() == [0, 1, 2, 3, 4]
    assert model.explained.tolist() == [True, True, False, True, True]  # no action moves the finger
    assert model.effect[:2] == pytest.approx(EFFECT, abs=1e-4)
    assert model.drift[:2] == pytest.approx(-SAG * np.eye(2, 5), abs=1e-4)
    assert model.offset[:2] == pytest.approx(0, abs=1e-4)


def test_all_is_free_until_a_demonstration_moves_its_object() -> None:
    by_episode = before_contact(DATA, FACTORS, SKILLS).reshape(len(DATA.episode_ends), STEPS)
    waves = DATA.episode_skills == 2
    assert by_episode[waves].all()
    # The transition that ends in the first moved state is not free, nor is any later one.
    assert by_episode[~waves, : TOUCHED - 1].all()
    assert not by_episode[~waves, TOUCHED - 1 :].any()


def test_the_accident_of_another_object_does_not_end_it() -> None:
    accident = made_up(0, 6, seed=9)
    free = before_contact(concatenate([DATA, accident]), FACTORS, SKILLS)
    assert free[len(DATA) :].all()
