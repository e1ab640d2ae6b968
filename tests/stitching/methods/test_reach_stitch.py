"""Reach-Stitch: nothing where the robot is in the set, else plans towards it, at a price."""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.methods.protocol import Models
from stitching.methods.reach_stitch import ReachStitch, ReachStitchSettings
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.models.initiation import Initiation, Steering
from stitching.planning.cem import CEM
from stitching.streams import stream

PLANE = ActionSpace(2, discrete=False)
PLANNER = CEM(population=60, elites=10, horizon=2, iterations=40, momentum=0.5, tolerance=0.05)
# The pose is (x, y), the first and last of three numbers; the first skill begins at two places.
SETS = Initiation(
    columns=[0, 2],
    scale=torch.tensor([2.0, 0.5]),
    states=[torch.tensor([[0.0, 1.0, 0.0], [6.0, 2.0, 0.0]]), torch.empty(0, 3)],
    others=[[1], []],
    radii=[0.5, float("inf")],
)


def moves_by(*steps: np.ndarray, drift: np.ndarray | None = None) -> Dynamics:
    """A linear ensemble: s' = s + s · A + a · B, one (2, 3) matrix B a member, A alike for all."""
    own = np.zeros((3, 3)) if drift is None else drift
    weights = [np.concatenate([own, step]) for step in steps]
    arrays = {
        "observation_mean": np.zeros(3, dtype=np.float32),
        "observation_std": np.ones(3, dtype=np.float32),
        "t.w0": np.array(weights, dtype=np.float32),
        "t.b0": np.zeros((len(steps), 1, 3), dtype=np.float32),
    }
    return Dynamics(arrays, DynamicsConfig())


SURE = np.array([[0.2, 0.0, 0.0], [0.0, 0.0, 0.1]])  # an action moves x and y


def reach(
    *steps: np.ndarray,
    beta: float = 0.0,
    sets: Initiation = SETS,
    drift: np.ndarray | None = None,
) -> ReachStitch:
    trained = {"initiation-sets": sets, "dynamics": moves_by(*steps, drift=drift)}
    return ReachStitch(ReachStitchSettings(beta=beta, cem=PLANNER), Models(PLANE, 2, trained))


def streams(n: int) -> list[np.random.Generator]:
    return [stream("reach", i) for i in range(n)]


def test_distances_are_to_the_nearest_pose_in_units_of_the_scale() -> None:
    states = torch.tensor([[4.0, 9.0, 0.0], [0.0, 9.0, 1.0], [6.0, 0.0, 0.25]])
    assert torch.allclose(SETS.distances(states, 0), torch.tensor([1.0, 2.0, 0.5]))
    assert SETS.outside(states, 0).tolist() == [True, True, False]
    stacked = states.expand(4, 3, 3)
    assert torch.allclose(SETS.distances(stacked, 0), torch.tensor([1.0, 2.0, 0.5]).expand(4, 3))


def test_where_nothing_is_known_nothing_is_done() -> None:
    states = torch.full((3, 3), 100.0)
    assert not reach(SURE).propose(states, 0, 1, streams(3)).wanted.any()


def test_only_what_lies_outside_is_planned_for() -> None:
    states = torch.tensor([[0.0, 0, 0], [2.0, 0, 0], [6.0, 0, 0]])
    proposal = reach(SURE).propose(states, None, 0, streams(3))
    assert proposal.wanted.tolist() == [False, True, False]
    alone = reach(SURE).propose(states[1:2], None, 0, streams(3)[1:2])
    assert np.array_equal(alone.actions[0], proposal.actions[1])


def test_steps_lead_into_the_set() -> None:
    stitcher = reach(SURE)
    states = torch.tensor([[2.0, 0.0, 0.5], [4.5, 0.0, -0.5]])
    before = SETS.distances(states, 0)
    for _ in range(12):
        proposal = stitcher.propose(states, None, 0, streams(2))
        moved = torch.from_numpy(proposal.actions[:, 0]) @ torch.from_numpy(SURE).float()
        states = torch.where(torch.from_numpy(proposal.wanted)[:, None], states + moved, states)
    assert (SETS.distances(states, 0) < before).all()
    assert not SETS.outside(states, 0).any()
    assert states[:, 0].tolist() == sorted(states[:, 0].tolist())  # each at the place nearest to it


def test_a_price_on_disagreement_keeps_plans_where_members_agree() -> None:
    other = SURE.copy()
    other[0, 1] = 2.0  # of what x's action does to a third number, members think differently
    states = torch.tensor([[2.0, 0.0, 1.0]])
    free, dear = (
        reach(SURE, other, beta=beta).propose(states, None, 0, streams(1)).actions[0, 0]
        for beta in (0.0, 10.0)
    )
    assert abs(dear[0]) < abs(free[0]) / 2
    assert dear[1] < -0.3  # y is as sure as before


def test_a_plan_is_judged_by_all_of_its_steps() -> None:
    """In numpy, float64: the mean over steps of nearness less the members' disagreement."""
    other = 1.5 * SURE
    starts, rng = np.array([[2.0, 0.0, 1.0], [5.0, 3.0, -0.5]]), stream("plans")
    sequences = rng.uniform(-1, 1, size=(2, 4, 2))
    expected = []
    for state, actions in zip(starts, sequences, strict=True):
        paths = state + np.stack([np.cumsum(actions @ member, axis=0) for member in (SURE, other)])
        poses = paths[..., [0, 2]] / [2.0, 0.5]  # (members, steps, pose)
        gaps = [np.linalg.norm(poses - place, axis=-1) for place in ([0.0, 0.0], [3.0, 0.0])]
        spread = paths.std(axis=0).mean(axis=-1)  # (steps,)
        expected.append((-np.minimum(*gaps).mean(axis=0) - 0.7 * spread).mean())
    begun, planned = (torch.tensor(each, dtype=torch.float32) for each in (starts, sequences))
    found = reach(SURE, other, beta=0.7)._imagine(begun, planned, following=0)
    np.testing.assert_allclose(found.numpy(), expected, atol=1e-5)


def test_it_plans_among_the_objects_of_the_nearest_start() -> None:
    """Dynamics are asked of objects as they know them, wherever these really are."""
    drift = np.zeros((3, 3))
    drift[1, 2] = 0.001  # what y does depends on the object, wrongly where it was never seen
    states = torch.tensor([[2.0, 77.0, 0.05], [4.5, -77.0, -0.05]])
    known = SETS.among_known_objects(states, SETS.nearest(states, 0), 0)
    assert torch.equal(known, torch.tensor([[2.0, 1.0, 0.05], [4.5, 2.0, -0.05]]))
    assert states[:, 1].tolist() == [77.0, -77.0]

    def proposed(sets: Initiation, states: Tensor) -> np.ndarray:
        return reach(SURE, sets=sets, drift=drift).propose(states, None, 0, streams(2)).actions

    as_they_are = proposed(replace(SETS, others=[[], []]), states)
    assert np.array_equal(proposed(SETS, states), proposed(SETS, known))
    gaps = np.abs(proposed(SETS, states) - as_they_are)[:, 0, 1]
    assert gaps.min() > 0.3


# Of five numbers the robot's are 4, 0 and 2, its pose 2 and 4; two actions.
MODEL = {
    "columns": np.array([2, 4]),
    "scale": np.array([2.0, 0.5], dtype=np.float32),
    "robot.columns": np.array([4, 0, 2]),
    "robot.drift": np.array([[0.1, 0.0, 0.2], [0.3, -0.1, 0.0], [0.0, 0.05, -0.2]]),
    "robot.effect": np.array([[0.2, 0.1], [0.5, 0.5], [0.0, -0.3]]),
    "robot.offset": np.array([0.01, 0.02, -0.03]),
}
MODEL = {name: array.astype(np.float32) if "." in name else array for name, array in MODEL.items()}
MODEL["robot.columns"] = np.array([4, 0, 2])


def test_steering_goes_a_third_of_the_way_or_as_far_as_actions_can() -> None:
    """Against the formula, written out in float64."""
    rng = stream("steering")
    states, poses = rng.normal(size=(6, 5)), rng.normal(size=(6, 2))
    found = Steering.of(MODEL).towards(
        torch.tensor(states, dtype=torch.float32), torch.tensor(poses, dtype=torch.float32), 3
    )
    drift, effect, offset = (
        MODEL[f"robot.{name}"].astype(np.float64) for name in ("drift", "effect", "offset")
    )
    back = np.linalg.inv(effect[[2, 0]])  # of the pose: numbers 2 and 4
    for state, pose, actions in zip(states, poses, found.numpy(), strict=True):
        x = state[[4, 0, 2]]
        for action in actions:
            alone = drift @ x + offset
            expected = np.clip(back @ ((pose - x[[2, 0]]) / 3 - alone[[2, 0]]), -1, 1)
            np.testing.assert_allclose(action, expected, atol=1e-4)
            x = x + alone + effect @ expected


def test_what_actions_hardly_move_is_left_alone() -> None:
    faint = MODEL | {"robot.effect": np.array([[0.2, 0], [0.5, 0.5], [0, 1e-6]], dtype=np.float32)}
    actions = Steering.of(faint).towards(torch.zeros(1, 5), torch.full((1, 2), 0.3), 1)
    assert abs(actions[0, 0, 1]) < 1e-3
    assert actions[0, 0, 0] > 0.3


# An arm of nine joints that an action moves by 0.1 each, and that sags by 0.01 a step.
JOINTS = 9
ARM = ActionSpace(JOINTS, discrete=False)
STEERING = Steering.of(
    {
        "columns": np.arange(JOINTS),
        "scale": np.ones(JOINTS, dtype=np.float32),
        "robot.columns": np.arange(JOINTS),
        "robot.drift": np.zeros((JOINTS, JOINTS), dtype=np.float32),
        "robot.effect": 0.1 * np.eye(JOINTS, dtype=np.float32),
        "robot.offset": np.full(JOINTS, -0.01, dtype=np.float32),
    }
)
ARMS_DYNAMICS = {
    "observation_mean": np.zeros(JOINTS, dtype=np.float32),
    "observation_std": np.ones(JOINTS, dtype=np.float32),
    "t.w0": np.concatenate([np.zeros((JOINTS, JOINTS)), 0.1 * np.eye(JOINTS)])[None].astype("f4"),
    "t.b0": np.full((1, 1, JOINTS), -0.01, dtype=np.float32),
}


def steps_of(steered: bool) -> int:
    """Until the arm is in its set, a distance of 3 away; 100 at most."""
    sets = Initiation(
        list(range(JOINTS)), torch.ones(JOINTS), [torch.ones(1, JOINTS)], [[]], [0.1], STEERING
    )
    trained = {"initiation-sets": sets, "dynamics": Dynamics(ARMS_DYNAMICS, DynamicsConfig())}
    stitcher = ReachStitch(ReachStitchSettings(steered=steered), Models(ARM, 1, trained))
    states, steps, noise = torch.zeros(1, JOINTS), 0, streams(1)
    while sets.outside(states, 0).any() and steps < 100:
        action = torch.from_numpy(stitcher.propose(states, None, 0, noise).actions[:, 0])
        states, steps = states + 0.1 * action - 0.01, steps + 1
    return steps


def test_a_search_that_is_steered_arrives_sooner() -> None:
    steered, by_itself = steps_of(steered=True), steps_of(steered=False)
    assert 11 <= steered <= 16  # (1 − 0.03) / 0.09 at least
    assert steered < by_itself < 100
