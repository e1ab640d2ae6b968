"""The demonstrator's arm: kinematics as in the simulator, and actions that move the hand."""

import numpy as np

from stitching.data.kitchen.arm import GRIP_OPEN, HOME, Arm, hand_turn
from stitching.envs.kitchen import KITCHEN
from stitching.streams import stream

ROW = np.arange(1)


def test_level_hand_points_away_with_its_fingers_side_by_side() -> None:
    level = hand_turn(0.0, 0.0, 0.0).as_matrix()
    np.testing.assert_allclose(level, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-12)
    left = hand_turn(0.3, 0.0, 0.0).apply([0, 0, 1])
    assert left[0] < 0
    assert hand_turn(0.0, 0.3, 0.0).apply([0, 0, 1])[2] > 0


def test_the_hand_reaches_a_pose_and_stays_there() -> None:
    env, arm = KITCHEN.vector_env(), Arm()
    env.reset([stream("arm", 0)])
    arm.see(env.observe(ROW)[0])
    position, turn = arm.position + np.array([0.1, 0.15, 0.1]), hand_turn(0.2, 0.2, 0.0)
    for _ in range(40):
        action = arm.reach(position, turn, 0.09, GRIP_OPEN)
        assert np.abs(action).max() <= 1
        env.step(ROW, action.astype(np.float32)[None])
        arm.see(env.observe(ROW)[0])
    assert np.linalg.norm(arm.position - position) < 0.01
    assert (turn * arm.turn.inv()).magnitude() < 0.05


def test_the_arm_holds_its_weight() -> None:
    env, arm = KITCHEN.vector_env(), Arm()
    env.reset([stream("arm", 0)])
    for _ in range(20):
        arm.see(env.observe(ROW)[0])
        action = arm.bend(HOME - arm.joints, GRIP_OPEN)
        env.step(ROW, action.astype(np.float32)[None])
    assert np.abs(env.positions(ROW)[0, :7] - HOME).max() < 0.02
