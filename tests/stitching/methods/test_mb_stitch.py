"""MB-Stitch: Eq. 2 along imagined paths in float64, and what comes of it."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
import torch

from stitching.envs.protocol import ActionSpace
from stitching.methods.mb_stitch import MBStitch, MBStitchSettings
from stitching.methods.protocol import Models
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.models.layers import init_mlp, prefixed
from stitching.planning.cem import CEM
from stitching.planning.objective import Norm, Price, conservative_value
from stitching.planning.random_shooting import RandomShooting
from stitching.streams import stream
from tests.sections import with_sections
from tests.stitching.methods.linear import ARM, MOVES, linear_agent, streams

# MB-Stitch against Eq. 2, one action sequence and one member at a time.

OBSERVATION, VALUES, MODELS = 3, 4, 5
CONDITIONS = np.array([[1.0, 0.0], [0.2, 0.8]], dtype=np.float32)
REDUCE: dict[Norm, Callable[[list[np.floating[Any]]], np.floating[Any]]] = {
    "mean": np.mean,
    "l2": np.linalg.norm,
    "max": np.max,
}


def random_models(actions: ActionSpace) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    scale = {
        "observation_mean": np.array([0.5, -1.0, 2.0], dtype=np.float32),
        "observation_std": np.array([0.25, 2.0, 1.0], dtype=np.float32),
    }
    inputs = OBSERVATION + CONDITIONS.shape[1]
    agent = scale | prefixed(init_mlp(VALUES, [inputs, 8, 1], stream("v")), "v")
    agent |= prefixed(init_mlp(1, [inputs, 8, actions.size], stream("policy")), "policy")
    agent["policy.log_std"] = np.zeros(actions.size, dtype=np.float32)
    model = init_mlp(MODELS, [OBSERVATION + actions.size, 8, OBSERVATION], stream("t"))
    return agent, scale | prefixed(model, "t")


def plain(weights: dict[str, np.ndarray], name: str, member: int, inputs: np.ndarray) -> np.ndarray:
    hidden = inputs @ weights[f"{name}.w0"][member].astype(np.float64)
    hidden = np.maximum(hidden + weights[f"{name}.b0"][member, 0], 0)
    return hidden @ weights[f"{name}.w1"][member] + weights[f"{name}.b1"][member, 0]


def equation_2(
    agent: dict[str, np.ndarray],
    model: dict[str, np.ndarray],
    state: np.ndarray,
    actions: np.ndarray,
    skill: int,
    stitcher: MBStitch,
) -> float:
    mean, std = model["observation_mean"].astype(np.float64), model["observation_std"]
    paths = []
    for member in range(MODELS):
        path = [state.astype(np.float64)]
        for action in actions:
            inputs = np.concatenate([(path[-1] - mean) / std, action])
            path.append(path[-1] + plain(model, "t", member, inputs) * std)
        paths.append(path[1:])
    average = np.mean([path[-1] for path in paths], axis=0)
    inputs = np.concatenate([(average - mean) / std, CONDITIONS[skill]])
    values = [plain(agent, "v", member, inputs)[0] for member in range(VALUES)]
    disagreements = [
        REDUCE[stitcher.settings.norm](
            [np.std([state[k] / std[k] for state in step]) for k in range(OBSERVATION)]
        )
        for step in zip(*paths, strict=True)
    ]
    disagreement = disagreements[-1] if stitcher.settings.price == "end" else np.mean(disagreements)
    one = stitcher.settings
    return np.mean(values) - one.alpha * np.std(values) - one.beta * disagreement


SETTINGS = with_sections(
    MBStitchSettings(limit=5, execute=2, alpha=2.0, beta=3.0, planner="random-shooting"),
    RandomShooting(population=300, horizon=2),
)


def mb_stitch(actions: ActionSpace, **settings: Any) -> MBStitch:
    agent, model = random_models(actions)
    trained = {
        "agent": Agent(agent, CONDITIONS, actions),
        "dynamics": Dynamics(model, DynamicsConfig(members=MODELS, width=8, hidden_layers=1)),
    }
    return MBStitch(replace(SETTINGS, **settings), Models(actions, len(CONDITIONS), trained))


def planned_from(n: int = 4) -> np.ndarray:
    return np.random.default_rng(0).normal(0, 2, (n, OBSERVATION)).astype(np.float32)


@pytest.mark.parametrize("space", [MOVES, ARM], ids=["discrete", "continuous"])
@pytest.mark.parametrize("norm", ["mean", "l2", "max"])
@pytest.mark.parametrize("price", ["end", "path"])
@pytest.mark.parametrize(("horizon", "skill"), [(1, 0), (3, 1)])
def test_the_score_is_equation_2(
    space: ActionSpace, norm: Norm, price: Price, horizon: int, skill: int
) -> None:
    stitcher, states = mb_stitch(space, norm=norm, price=price), planned_from()
    problems = torch.tensor([3, 0, 2])  # those that a planner still works on
    sequences = space.uniform(stream("actions"), (len(problems), 6, horizon))
    scores = stitcher.score(torch.from_numpy(states), skill)(problems, torch.from_numpy(sequences))
    assert scores.shape == (3, 6)
    expected = [
        [equation_2(*random_models(space), states[p], actions, skill, stitcher) for actions in plan]
        for p, plan in zip(problems, sequences, strict=True)
    ]
    np.testing.assert_allclose(scores, expected, atol=1e-4)


@pytest.mark.parametrize("norm", ["mean", "l2", "max"])
def test_of_one_step_the_path_is_its_end(norm: Norm) -> None:
    states, sequences = torch.from_numpy(planned_from()), ARM.uniform(stream("a"), (4, 6, 1))
    end, path = (
        mb_stitch(ARM, norm=norm, price=price).score(states, 1)(
            torch.arange(4), torch.from_numpy(sequences)
        )
        for price in ("end", "path")
    )
    assert torch.equal(end, path)


@pytest.mark.parametrize("space", [MOVES, ARM], ids=["discrete", "continuous"])
def test_the_price_of_the_end_is_that_of_the_imagined_state(space: ActionSpace) -> None:
    """To the last bit: what planners maximise decides the bytes of results."""
    stitcher, starts = mb_stitch(space), torch.from_numpy(planned_from(6))
    sequences = torch.from_numpy(space.uniform(stream("actions"), (6, 5)))
    scores = stitcher.score(starts, 1)(torch.arange(6), sequences[:, None])
    imagined = stitcher.dynamics.imagine(starts, sequences)
    expected = conservative_value(
        stitcher.agent.values(imagined.mean(dim=0), 1), stitcher.dynamics.scaled(imagined), 2.0, 3.0
    )
    assert torch.equal(scores[:, 0], expected)


@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (2.0, 3.0), (20.0, 0.0)])
def test_the_best_of_all_sequences_is_proposed(alpha: float, beta: float) -> None:
    """Sixteen sequences of two moves, of which 300 samples miss none."""
    stitcher, states = mb_stitch(MOVES, alpha=alpha, beta=beta), planned_from(6)
    proposed = stitcher.propose(torch.from_numpy(states), 0, 1, streams(6)).actions.argmax(axis=2)
    for state, moves in zip(states, proposed, strict=True):
        scores = {
            pair: equation_2(*random_models(MOVES), state, np.eye(4)[list(pair)], 1, stitcher)
            for pair in product(range(4), repeat=2)
        }
        assert scores[tuple(moves)] == pytest.approx(max(scores.values()), abs=1e-4)


@pytest.mark.parametrize("execute", [1, 2])
def test_as_much_of_the_plan_is_proposed_as_is_to_be_executed(execute: int) -> None:
    stitcher, states = mb_stitch(ARM, execute=execute), torch.from_numpy(planned_from())
    plan = SETTINGS.chosen.plan(stitcher.score(states, 1), streams(4), ARM)
    proposed = stitcher.propose(states, 0, 1, streams(4)).actions
    assert proposed.shape == (4, execute, 2)
    assert np.array_equal(proposed, plan.actions[:, :execute])


def test_the_previous_skill_does_not_matter_to_mb_stitch() -> None:
    stitcher, states = mb_stitch(MOVES), torch.from_numpy(planned_from())
    from_first = stitcher.propose(states, 0, 1, streams(4)).actions
    assert np.array_equal(stitcher.propose(states, 1, 1, streams(4)).actions, from_first)


# Two members each, linear, so that the right plan can be told: x moves by the action.


def line_stitcher(
    values: list[list[float]], steps: list[list[list[float]]], **settings: Any
) -> MBStitch:
    """values (members, 2): V = v · s;  steps (members, 2, 2): s' = s + a · B."""
    scale = {"observation_mean": np.zeros(2), "observation_std": np.ones(2)}
    model = scale | {
        "t.w0": np.concatenate([np.zeros((len(steps), 2, 2)), np.array(steps)], axis=1),
        "t.b0": np.zeros((len(steps), 1, 2)),
    }
    model = {name: array.astype(np.float32) for name, array in model.items()}
    v = np.pad(np.array(values), ((0, 0), (0, 1)))
    trained = {
        "agent": linear_agent(v, np.zeros((3, 2)), np.ones((1, 1)), ARM),
        "dynamics": Dynamics(model, DynamicsConfig()),
    }
    planner = CEM(population=60, elites=10, horizon=1, iterations=100)
    usual = with_sections(MBStitchSettings(limit=5, alpha=0.0, beta=0.0), planner)
    return MBStitch(replace(usual, **settings), Models(ARM, 1, trained))


SURE = [[1.0, 0.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("values", "steps", "settings", "moves"),
    [
        ([[1, -1], [1, -1]], [SURE, SURE], {}, (1, -1)),
        # Mean V is x − y, but the members disagree about x.
        ([[2.5, -1], [-0.5, -1]], [SURE, SURE], {"alpha": 0.0}, (1, -1)),
        ([[2.5, -1], [-0.5, -1]], [SURE, SURE], {"alpha": 5.0}, (0, -1)),
        # The models agree on average, but not about what the first action does.
        ([[1, -1]], [SURE, [[1.0, 3.0], [0.0, 1.0]]], {"beta": 5.0}, (0, -1)),
        ([[1, 1]], [SURE, [[1.0, 3.0], [0.0, 1.0]]], {"beta": 0.0}, (1, 1)),
    ],
    ids=["value alone", "α = 0", "α = 5", "β = 5", "β = 0"],
)
def test_doubt_steers_the_plan(
    values: list[list[float]],
    steps: list[list[list[float]]],
    settings: dict[str, float],
    moves: tuple[float, float],
) -> None:
    stitcher = line_stitcher(values, steps, **settings)
    proposed = stitcher.propose(torch.zeros(3, 2), 0, 0, streams(3)).actions
    np.testing.assert_allclose(proposed, np.broadcast_to(moves, (3, 1, 2)), atol=0.05)


@pytest.mark.parametrize(
    ("values", "settings", "wanted"),
    [
        ([[1, -1], [1, -1]], {}, True),
        ([[0, 0]], {}, False),  # nothing is better than what is
        # The members of V agree at zero and nowhere else.
        ([[3, 0], [1, 0]], {"alpha": 1.0}, True),
        ([[3, 0], [1, 0]], {"alpha": 3.0}, False),
    ],
    ids=["rises", "flat", "α = 1", "α = 3"],
)
def test_a_selective_stitch_wants_plans_that_beat_the_present(
    values: list[list[float]], settings: dict[str, float], wanted: bool
) -> None:
    always = line_stitcher(values, [SURE, SURE], **settings)
    selective = line_stitcher(values, [SURE, SURE], selective=True, **settings)
    proposal = selective.propose(torch.zeros(3, 2), 0, 0, streams(3))
    assert proposal.wanted.tolist() == [wanted] * 3
    usual = always.propose(torch.zeros(3, 2), 0, 0, streams(3))
    assert usual.wanted.all()
    assert np.array_equal(usual.actions, proposal.actions)


def test_the_present_is_equation_2_without_a_prediction() -> None:
    stitcher, states = mb_stitch(ARM, alpha=2.0, beta=7.0), torch.from_numpy(planned_from())
    values = stitcher.agent.values(states, 1)
    expected = values.mean(dim=0) - 2 * values.std(dim=0, correction=0)
    np.testing.assert_allclose(stitcher.present(states, 1), expected, atol=1e-5)
