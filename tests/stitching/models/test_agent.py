"""Agents at work: values and actions against float64 arithmetic, modes and samples."""

import numpy as np
import pytest
import torch
from scipy.stats import kstest

from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.layers import init_mlp, prefixed
from stitching.models.losses import LOG_STD_RANGE
from stitching.streams import stream

OBSERVATION, MEMBERS, HIDDEN = 3, 4, 16
CONDITIONS = np.eye(2, dtype=np.float32)
MOVES, ARM = ActionSpace(4, discrete=True), ActionSpace(4, discrete=False)
LOG_STD = np.array([0.0, -1.0, 9.0, -9.0], dtype=np.float32)  # the last two out of range
SPACES = pytest.mark.parametrize("space", [MOVES, ARM], ids=["discrete", "continuous"])


def weights(seed: int = 0) -> dict[str, np.ndarray]:
    sizes = [OBSERVATION + CONDITIONS.shape[1], HIDDEN]
    policy = init_mlp(1, [*sizes, MOVES.size], stream("policy", seed))
    return {
        "observation_mean": np.array([1.0, -2.0, 0.5], dtype=np.float32),
        "observation_std": np.array([0.5, 3.0, 1.0], dtype=np.float32),
        **prefixed(init_mlp(MEMBERS, [*sizes, 1], stream("v", seed)), "v"),
        **prefixed(policy | {"log_std": torch.from_numpy(LOG_STD)}, "policy"),
    }


def plain(model: dict[str, np.ndarray], name: str, state: np.ndarray, condition: int) -> np.ndarray:
    """One state through every member, in float64: (members, out)."""
    scaled = (state.astype(np.float64) - model["observation_mean"]) / model["observation_std"]
    inputs = np.concatenate([scaled, CONDITIONS[condition]])
    outputs = []
    for member in range(len(model[f"{name}.w0"])):
        hidden = inputs @ model[f"{name}.w0"][member] + model[f"{name}.b0"][member, 0]
        hidden = np.maximum(hidden, 0)
        outputs.append(hidden @ model[f"{name}.w1"][member] + model[f"{name}.b1"][member, 0])
    return np.array(outputs)


def states(n: int = 6) -> np.ndarray:
    return np.random.default_rng(1).normal(0, 2, (n, OBSERVATION)).astype(np.float32)


def softmax(logits: np.ndarray) -> np.ndarray:
    exponentials = np.exp(logits - logits.max())
    return exponentials / exponentials.sum()


@SPACES
@pytest.mark.parametrize("condition", [0, 1])
def test_values_of_every_member(space: ActionSpace, condition: int) -> None:
    values = Agent(weights(), CONDITIONS, space).values(torch.from_numpy(states()), condition)
    assert values.shape == (MEMBERS, 6)
    expected = np.stack([plain(weights(), "v", s, condition)[:, 0] for s in states()], axis=1)
    np.testing.assert_allclose(values, expected, atol=1e-5)


@pytest.mark.parametrize("condition", [0, 1])
def test_the_mode_of_a_discrete_policy_is_its_likeliest_action(condition: int) -> None:
    actions = Agent(weights(), CONDITIONS, MOVES).act(torch.from_numpy(states()), condition, None)
    assert actions.dtype == np.float32
    logits = [plain(weights(), "policy", s, condition)[0] for s in states()]
    np.testing.assert_array_equal(actions, np.eye(4)[np.argmax(logits, axis=1)])


@pytest.mark.parametrize("condition", [0, 1])
def test_the_mode_of_a_gaussian_policy_is_its_mean(condition: int) -> None:
    actions = Agent(weights(), CONDITIONS, ARM).act(torch.from_numpy(states()), condition, None)
    assert actions.dtype == np.float32
    expected = [np.tanh(plain(weights(), "policy", s, condition)[0]) for s in states()]
    np.testing.assert_allclose(actions, expected, atol=1e-5)


@SPACES
def test_the_mode_has_no_temperature(space: ActionSpace) -> None:
    agent, seen = Agent(weights(), CONDITIONS, space), torch.from_numpy(states())
    for temperature in (0.0, 0.5):
        np.testing.assert_array_equal(
            agent.act(seen, 0, None, temperature), agent.act(seen, 0, None)
        )


@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
def test_noise_picks_the_action_in_whose_share_it_falls(temperature: float) -> None:
    """Shares are the softmax of logits over the temperature: at 1 they are as learned."""
    agent = Agent(weights(), CONDITIONS, MOVES)
    noise = np.linspace(0, 1, 400, endpoint=False, dtype=np.float32)[:, None]
    for state in states():
        alike = torch.from_numpy(state).expand(400, -1)
        sampled = agent.act(alike, 0, noise, temperature).argmax(axis=1)
        ends = np.cumsum(softmax(plain(weights(), "policy", state, 0)[0] / temperature))
        clear = np.abs(noise - ends).min(axis=1) > 1e-5
        assert clear.sum() > 390
        np.testing.assert_array_equal(
            sampled[clear], np.searchsorted(ends, noise[:, 0])[clear].clip(max=3)
        )


def test_sampled_actions_follow_the_softmax() -> None:
    state, draws = states()[0], 20_000
    noise = stream("noise").random((draws, 1), dtype=np.float32)
    agent = Agent(weights(), CONDITIONS, MOVES)
    frequencies = agent.act(torch.from_numpy(state).expand(draws, -1), 1, noise).mean(axis=0)
    shares = softmax(plain(weights(), "policy", state, 1)[0])
    assert (np.abs(frequencies - shares) < 4 * np.sqrt(shares * (1 - shares) / draws)).all()


@pytest.mark.parametrize("noise", [0.0, 0.5, np.nextafter(np.float32(1), np.float32(0)), 1.0])
def test_any_noise_gives_one_action(noise: float) -> None:
    """Even where rounding leaves the shares' sum a little below 1."""
    sampled = Agent(weights(), CONDITIONS, MOVES).act(
        torch.from_numpy(states(500)), 0, np.full((500, 1), noise, dtype=np.float32)
    )
    assert (sampled.sum(axis=1) == 1).all()
    assert sampled.max() == 1


@pytest.mark.parametrize("temperature", [0.25, 1.0])
def test_gaussian_samples_are_clipped_to_the_box(temperature: float) -> None:
    """Their deviation is the learned one times the temperature."""
    draws = 5000
    noise = stream("noise").standard_normal((draws, 4), dtype=np.float32)
    state = states()[2]
    sampled = Agent(weights(), CONDITIONS, ARM).act(
        torch.from_numpy(state).expand(draws, -1), 0, noise, temperature
    )
    mean = np.tanh(plain(weights(), "policy", state, 0)[0])
    std = np.exp(np.clip(LOG_STD.astype(np.float64), *LOG_STD_RANGE))
    np.testing.assert_allclose(sampled, np.clip(mean + temperature * noise * std, -1, 1), atol=1e-5)
    assert np.abs(sampled).max() == 1


def test_gaussian_samples_have_the_policys_spread() -> None:
    model = weights()
    model["policy.log_std"] = np.full(4, np.log(0.05), dtype=np.float32)
    model["policy.w1"] *= 0.1  # far from the bounds
    draws, state = 5000, states()[0]
    noise = stream("noise").standard_normal((draws, 4), dtype=np.float32)
    sampled = Agent(model, CONDITIONS, ARM).act(torch.from_numpy(state).expand(draws, -1), 0, noise)
    mean = np.tanh(plain(model, "policy", state, 0)[0])
    for k in range(4):
        assert kstest(sampled[:, k], "norm", args=(mean[k], 0.05)).pvalue > 0.01


@SPACES
def test_what_lies_outside_the_data_s_range_is_held_to_it(space: ActionSpace) -> None:
    low, high = np.array([-1, -1, 0], np.float32), np.array([1, 2, 0], np.float32)
    free = Agent(weights(), CONDITIONS, space)
    bounds = {"observation_low": low, "observation_high": high}
    held = Agent(weights() | bounds, CONDITIONS, space)
    seen, within = torch.from_numpy(states()), torch.from_numpy(states().clip(low, high))
    assert not torch.equal(seen, within)
    assert torch.equal(held.values(seen, 1), free.values(within, 1))
    assert np.array_equal(held.act(seen, 1, None), free.act(within, 1, None))


@SPACES
def test_conditions_matter(space: ActionSpace) -> None:
    agent, there = Agent(weights(), CONDITIONS, space), torch.from_numpy(states())
    assert not torch.equal(agent.values(there, 0), agent.values(there, 1))


@SPACES
def test_the_weights_are_left_as_they_were(space: ActionSpace) -> None:
    """Workers make several agents of one loaded artifact."""
    model = weights()
    before = {name: array.tobytes() for name, array in model.items()}
    noise = stream("noise").random((6, 4 if space is ARM else 1), dtype=np.float32)
    agents = [Agent(model, CONDITIONS, space) for _ in range(2)]
    first, second = (agent.act(torch.from_numpy(states()), 0, noise) for agent in agents)
    assert first.tobytes() == second.tobytes()
    assert {name: array.tobytes() for name, array in model.items()} == before


@SPACES
def test_nobody_acts(space: ActionSpace) -> None:
    agent, nobody = Agent(weights(), CONDITIONS, space), torch.zeros(0, OBSERVATION)
    assert agent.act(nobody, 0, None).shape == (0, 4)
    assert agent.values(nobody, 0).shape == (MEMBERS, 0)


@SPACES
@pytest.mark.parametrize("condition", [0, 1])
def test_networks_of_one_skill_each(space: ActionSpace, condition: int) -> None:
    """Of several skills' networks, each by itself what it would be alone."""
    apart = {f"{skill}.{name}": array for skill in (0, 1) for name, array in weights(skill).items()}
    together, alone = Agent(apart, CONDITIONS, space), Agent(weights(condition), CONDITIONS, space)
    seen = torch.from_numpy(states())
    assert together.values(seen, condition).equal(alone.values(seen, condition))
    assert np.array_equal(together.act(seen, condition, None), alone.act(seen, condition, None))
    rounded = together.at_precision("bfloat16"), alone.at_precision("bfloat16")
    assert rounded[0].values(seen, condition).equal(rounded[1].values(seen, condition))
