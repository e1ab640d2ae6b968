"""The methods of joining skills: what they propose, and Eq. 2 along imagined paths in float64."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
import torch

from stitching.data.mixtures import skill_pairs
from stitching.envs.maze import Maze
from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.dynamics import Dynamics, DynamicsConfig
from stitching.models.layers import init_mlp, prefixed
from stitching.planning.cem import CEM
from stitching.planning.objective import Norm, Price, conservative_value
from stitching.planning.random_shooting import RandomShooting
from stitching.stitchers import (
    MBStitch,
    MFStitch,
    NoStitch,
    RandomStitch,
    Stitcher,
    policy_noise,
)
from stitching.streams import stream

MOVES, ARM = ActionSpace(4, discrete=True), ActionSpace(2, discrete=False)
PROPOSERS = ["random-stitch", "mf-stitch", "mb-stitch", "mb-stitch[execute=1]"]
DRAWING = ["random-stitch", "mb-stitch"]  # those that leave something to chance


def streams(n: int, use: str = "stitch") -> list[np.random.Generator]:
    return [stream(use, i) for i in range(n)]


# What all that propose must do.


@pytest.fixture
def states(maze: Maze) -> torch.Tensor:
    return torch.from_numpy(maze.observations[maze.free][::4])


@pytest.mark.parametrize("method", PROPOSERS)
def test_proposals_are_actions(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    stitcher = stitchers[method]
    for n in (1, len(states)):
        actions = stitcher.propose(states[:n], 0, 1, streams(n)).actions
        steps = 4 if method == "mb-stitch" else 1
        assert actions.shape == (n, steps, MOVES.size)
        assert actions.dtype == np.float32
        assert set(np.unique(actions)) == {0, 1}
        assert (actions.sum(axis=2) == 1).all()


@pytest.mark.parametrize("method", PROPOSERS)
def test_a_proposal_belongs_to_its_stream_and_state(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    stitcher, n = stitchers[method], len(states)
    together = stitcher.propose(states, 0, 1, streams(n)).actions
    torch.manual_seed(0)
    assert np.array_equal(stitcher.propose(states, 0, 1, streams(n)).actions, together)
    for row in range(n):
        alone = stitcher.propose(states[row : row + 1], 0, 1, [streams(n)[row]]).actions
        assert np.array_equal(alone[0], together[row])


@pytest.mark.parametrize("method", DRAWING)
def test_other_streams_bring_other_proposals(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    same = states[:1].expand(40, -1)
    proposals = stitchers[method].propose(same, 0, 1, streams(40)).actions
    assert len(np.unique(proposals, axis=0)) > 1


@pytest.mark.parametrize("method", DRAWING)
def test_streams_go_on_from_call_to_call(
    method: str, stitchers: dict[str, Stitcher], states: torch.Tensor
) -> None:
    same, generators = states[:1].expand(40, -1), streams(40)
    first, second = (stitchers[method].propose(same, 0, 1, generators).actions for _ in range(2))
    assert not np.array_equal(first, second)


# Method by method.


def test_no_stitch_takes_no_step() -> None:
    assert NoStitch().limit == 0
    with pytest.raises(AssertionError, match="no stitching"):
        NoStitch().propose(torch.zeros(1, 6), 0, 1, streams(1))


def test_random_stitch_is_uniform_whatever_the_state() -> None:
    stitcher = RandomStitch(MOVES, limit=5)
    actions = stitcher.propose(torch.zeros(4000, 6), 0, 1, streams(4000)).actions
    np.testing.assert_allclose(actions.mean(axis=(0, 1)), 0.25, atol=0.03)
    elsewhere = stitcher.propose(torch.ones(4000, 6), 2, 3, streams(4000)).actions
    assert np.array_equal(elsewhere, actions)


def test_random_stitch_fills_the_box() -> None:
    actions = RandomStitch(ARM, limit=5).propose(torch.zeros(2000, 6), 0, 1, streams(2000)).actions
    assert actions.shape == (2000, 1, 2)
    assert np.abs(actions).max() <= 1
    np.testing.assert_allclose(
        np.quantile(actions[:, 0], [0.25, 0.5, 0.75], axis=0), [[-0.5] * 2, [0] * 2, [0.5] * 2],
        atol=0.08,
    )  # fmt: skip


def linear_agent(
    v: np.ndarray, policy: np.ndarray, conditions: np.ndarray, actions: ActionSpace
) -> Agent:
    """V and policy as linear maps: v (members, in), policy (in, action); in = state + condition."""
    states = policy.shape[0] - conditions.shape[1]
    weights = {
        "observation_mean": np.zeros(states),
        "observation_std": np.ones(states),
        "v.w0": v[..., None],
        "v.b0": np.zeros((len(v), 1, 1)),
        "policy.w0": policy[None],
        "policy.b0": np.zeros((1, 1, actions.size)),
        "policy.log_std": np.zeros(actions.size),
    }
    weights = {name: array.astype(np.float32) for name, array in weights.items()}
    return Agent(weights, conditions.astype(np.float32), actions)


def test_mf_stitch_asks_its_policy_about_the_ordered_pair() -> None:
    """This policy heads for the following skill and shuns the previous one."""
    one_hot = np.eye(4, dtype=np.float32)
    conditions = np.array([[*one_hot[i], *one_hot[j]] for i, j in skill_pairs(4)])
    towards = np.concatenate([np.zeros((6, 4)), -50 * np.eye(4), 50 * np.eye(4)])
    policy = linear_agent(np.zeros((1, 14)), towards, conditions, MOVES)
    pairs = {pair: row for row, pair in enumerate(skill_pairs(4))}
    stitcher = MFStitch(policy, pairs, limit=5)
    for previous, following in permutations(range(4), 2):
        actions = stitcher.propose(torch.zeros(10, 6), previous, following, streams(10)).actions
        assert (actions.argmax(axis=2) == following).all()


def test_mf_stitch_plays_its_policys_mode() -> None:
    likes = np.log([0.1, 0.2, 0.4, 0.3])
    policy = linear_agent(np.zeros((1, 2)), np.stack([0 * likes, likes]), np.ones((1, 1)), MOVES)
    stitcher = MFStitch(policy, {(0, 1): 0}, limit=5)
    actions = stitcher.propose(torch.zeros(50, 1), 0, 1, streams(50)).actions
    assert (actions.argmax(axis=2) == 2).all()


def test_policy_noise_is_each_streams_own() -> None:
    uniform = policy_noise(MOVES, streams(500))
    normal = policy_noise(ARM, streams(500))
    assert (uniform.shape, normal.shape) == ((500, 1), (500, 2))
    assert uniform.dtype == normal.dtype == np.float32
    assert 0 <= uniform.min() < 0.05 < 0.95 < uniform.max() <= 1
    assert abs(normal.mean()) < 0.1
    assert normal.std() == pytest.approx(1, abs=0.1)
    for space, noise in ((MOVES, uniform), (ARM, normal)):
        assert np.array_equal(policy_noise(space, streams(500)[7:9]), noise[7:9])


# MB-Stitch against Eq. 2, one action sequence and one member at a time.

OBSERVATION, VALUES, MODELS = 3, 4, 5
CONDITIONS = np.array([[1.0, 0.0], [0.2, 0.8]], dtype=np.float32)
REDUCE = {"mean": np.mean, "l2": np.linalg.norm, "max": np.max}


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
    actions: Sequence[np.ndarray],
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
        REDUCE[stitcher.norm](
            [np.std([state[k] / std[k] for state in step]) for k in range(OBSERVATION)]
        )
        for step in zip(*paths, strict=True)
    ]
    disagreement = disagreements[-1] if stitcher.price == "end" else np.mean(disagreements)
    return np.mean(values) - stitcher.alpha * np.std(values) - stitcher.beta * disagreement


def mb_stitch(actions: ActionSpace, norm: Norm = "mean", **settings: float | Price) -> MBStitch:
    agent, model = random_models(actions)
    config = DynamicsConfig(members=MODELS, width=8, hidden_layers=1)
    stitcher = MBStitch(
        Agent(agent, CONDITIONS, actions),
        Dynamics(model, config),
        RandomShooting(population=300, horizon=2),
        actions,
        alpha=2.0,
        beta=3.0,
        norm=norm,
        execute=2,
        limit=5,
    )
    return replace(stitcher, **settings)


def planned_from(n: int = 4) -> np.ndarray:
    return np.random.default_rng(0).normal(0, 2, (n, OBSERVATION)).astype(np.float32)


@pytest.mark.parametrize("space", [MOVES, ARM], ids=["discrete", "continuous"])
@pytest.mark.parametrize("norm", ["mean", "l2", "max"])
@pytest.mark.parametrize("price", ["end", "path"])
@pytest.mark.parametrize(("horizon", "skill"), [(1, 0), (3, 1)])
def test_the_score_is_equation_2(
    space: ActionSpace, norm: Norm, price: Price, horizon: int, skill: int
) -> None:
    stitcher, states = mb_stitch(space, norm, price=price), planned_from()
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
        mb_stitch(ARM, norm, price=price).score(states, 1)(
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
    plan = stitcher.planner.plan(stitcher.score(states, 1), streams(4), ARM)
    proposed = stitcher.propose(states, 0, 1, streams(4)).actions
    assert proposed.shape == (4, execute, 2)
    assert np.array_equal(proposed, plan.actions[:, :execute])


def test_the_previous_skill_does_not_matter_to_mb_stitch() -> None:
    stitcher, states = mb_stitch(MOVES), torch.from_numpy(planned_from())
    from_first = stitcher.propose(states, 0, 1, streams(4)).actions
    assert np.array_equal(stitcher.propose(states, 1, 1, streams(4)).actions, from_first)


# Two members each, linear, so that the right plan can be told: x moves by the action.


def line_stitcher(
    values: list[list[float]], steps: list[list[list[float]]], **settings: float
) -> MBStitch:
    """values (members, 2): V = v · s;  steps (members, 2, 2): s' = s + a · B."""
    scale = {"observation_mean": np.zeros(2), "observation_std": np.ones(2)}
    model = scale | {
        "t.w0": np.concatenate([np.zeros((len(steps), 2, 2)), np.array(steps)], axis=1),
        "t.b0": np.zeros((len(steps), 1, 2)),
    }
    model = {name: array.astype(np.float32) for name, array in model.items()}
    v = np.pad(np.array(values), ((0, 0), (0, 1)))
    return MBStitch(
        linear_agent(v, np.zeros((3, 2)), np.ones((1, 1)), ARM),
        Dynamics(model, DynamicsConfig()),
        CEM(population=60, elites=10, horizon=1, iterations=100),
        ARM,
        **{"alpha": 0.0, "beta": 0.0, "norm": "mean", "execute": 1, "limit": 5, **settings},
    )


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
    values: list, steps: list, settings: dict[str, float], moves: tuple[float, float]
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
    values: list, settings: dict[str, float], wanted: bool
) -> None:
    always = line_stitcher(values, [SURE, SURE], **settings)
    proposal = replace(always, selective=True).propose(torch.zeros(3, 2), 0, 0, streams(3))
    assert proposal.wanted.tolist() == [wanted] * 3
    usual = always.propose(torch.zeros(3, 2), 0, 0, streams(3))
    assert usual.wanted.all()
    assert np.array_equal(usual.actions, proposal.actions)


def test_the_present_is_equation_2_without_a_prediction() -> None:
    stitcher, states = mb_stitch(ARM, alpha=2.0, beta=7.0), torch.from_numpy(planned_from())
    values = stitcher.agent.values(states, 1)
    expected = values.mean(dim=0) - 2 * values.std(dim=0, correction=0)
    np.testing.assert_allclose(stitcher.present(states, 1), expected, atol=1e-5)
