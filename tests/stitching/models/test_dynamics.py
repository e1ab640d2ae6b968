"""The dynamics ensemble: it learns the maze, and doubts what it has not seen."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from stitching.data.maze import MazeDataConfig, exploration
from stitching.data.transitions import Transitions
from stitching.envs.maze import MAZE, MOVES
from stitching.models.dynamics import Dynamics, DynamicsConfig, train_dynamics
from stitching.models.layers import Activation, Precision, init_mlp, prefixed
from stitching.models.scale import observation_scale
from stitching.streams import stream

TINY = DynamicsConfig(updates=40, batch_size=32, members=3, width=16, log_every=10)
SMALL = DynamicsConfig(updates=1000, batch_size=128, learning_rate=3e-3, members=3, width=64)


def every_move() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Each (cell, move) once: cells, actions, cells after."""
    cells = np.repeat(np.argwhere(MAZE.free), len(MOVES), axis=0)
    moves = np.tile(np.arange(len(MOVES)), len(cells) // len(MOVES))
    after = MAZE.successors[cells[:, 0], cells[:, 1], moves]
    return cells, np.eye(len(MOVES), dtype=np.float32)[moves], after


def seen_from(cells: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(MAZE.observations[tuple(cells.T)])


def explored(seed: int = 0) -> Transitions:
    return exploration(MAZE, MazeDataConfig(), seed)


def part(data: Transitions, chosen: np.ndarray) -> Transitions:
    """These rows, each an episode of its own."""
    count = int(chosen.sum())
    return Transitions(
        observations=data.observations[chosen],
        actions=data.actions[chosen],
        next_observations=data.next_observations[chosen],
        episode_ends=np.arange(1, count + 1),
        episode_skills=np.full(count, -1),
        episode_successes=np.zeros(count, dtype=bool),
    )


@pytest.fixture(scope="module")
def maze_dynamics() -> Dynamics:
    return Dynamics(train_dynamics(explored(), SMALL, "maze").weights, SMALL)


def test_learns_where_every_move_leads(maze_dynamics: Dynamics) -> None:
    cells, actions, after = every_move()
    predicted = maze_dynamics(seen_from(cells)[None], torch.from_numpy(actions))
    assert predicted.shape == (SMALL.members, len(cells), MAZE.observation_size)
    reached = (predicted[..., :2] * len(MAZE.layout)).round().int().numpy()
    for member in reached:
        assert (member == after).all(axis=1).mean() >= 0.99


def test_learns_what_is_seen_after_it(maze_dynamics: Dynamics) -> None:
    cells, actions, after = every_move()
    predicted = maze_dynamics(seen_from(cells)[None], torch.from_numpy(actions)).mean(dim=0)
    error = (predicted - seen_from(after)).square().mean()
    change = (seen_from(after) - seen_from(cells)).square().mean()
    assert error < 0.05 * change


def test_members_disagree_where_they_have_not_been() -> None:
    """Learned from the lower rows alone: the upper ones are unknown."""
    data = explored()
    row = np.rint(data.observations[:, 0] * len(MAZE.layout))
    config = replace(SMALL, updates=300)
    trained = train_dynamics(part(data, row >= 4), config, "below")
    dynamics = Dynamics(trained.weights, config)
    cells, actions, _ = every_move()
    predicted = dynamics(seen_from(cells)[None], torch.from_numpy(actions))
    spread = dynamics.scaled(predicted).std(dim=0, correction=0).mean(dim=1).numpy()
    known = cells[:, 0] >= 4
    assert np.median(spread[~known]) > 3 * np.median(spread[known])


# Arithmetic.


def random_weights(activation_sizes: list[int], observation: int) -> dict[str, np.ndarray]:
    return {
        "observation_mean": np.linspace(-1, 1, observation, dtype=np.float32),
        "observation_std": np.linspace(0.5, 2, observation, dtype=np.float32),
        **prefixed(init_mlp(3, activation_sizes, stream("t")), "t"),
    }


@pytest.mark.parametrize("activation", ["relu", "elu", "sigmoid"])
def test_a_prediction_is_the_state_plus_each_members_own_change(
    activation: Activation,
) -> None:
    activations: dict[Activation, Callable[[np.ndarray], np.ndarray]] = {
        "relu": lambda x: np.maximum(x, 0),
        "elu": lambda x: np.where(x > 0, x, np.exp(np.minimum(x, 0)) - 1),
        "sigmoid": lambda x: 1 / (1 + np.exp(-x)),
    }
    weights = random_weights([4 + 2, 8, 4], observation=4)
    dynamics = Dynamics(weights, replace(TINY, activation=activation))
    rng = np.random.default_rng(0)
    states = rng.standard_normal((3, 5, 4), dtype=np.float32)  # each member on its own path
    actions = rng.standard_normal((5, 2), dtype=np.float32)
    predicted = dynamics(torch.from_numpy(states), torch.from_numpy(actions))
    mean, std = weights["observation_mean"], weights["observation_std"].astype(np.float64)
    for member in range(3):
        for n in range(5):
            inputs = np.concatenate([(states[member, n] - mean) / std, actions[n]])
            hidden = inputs @ weights["t.w0"][member] + weights["t.b0"][member, 0]
            change = activations[activation](hidden) @ weights["t.w1"][member]
            change = change + weights["t.b1"][member, 0]
            expected = states[member, n] + change * std
            np.testing.assert_allclose(predicted[member, n], expected, atol=1e-5)
    scaled = dynamics.scaled(torch.from_numpy(states))
    np.testing.assert_allclose(scaled, states / std, rtol=1e-6)


def test_one_set_of_states_is_shown_to_every_member() -> None:
    dynamics = Dynamics(random_weights([4 + 2, 8, 4], observation=4), TINY)
    states, actions = (
        torch.randn(1, 5, 4, generator=torch.Generator().manual_seed(0)),
        torch.ones(5, 2),
    )
    shown = dynamics(states, actions)
    assert shown.shape == (3, 5, 4)
    assert torch.equal(shown, dynamics(states.expand(3, -1, -1), actions))


def test_training_is_a_plain_regression() -> None:
    """Member for member the same as torch networks in float64 with an optimiser each."""
    data, config = part(explored(), np.arange(4000) < 200), TINY
    mean, std = observation_scale(data.observations)
    scaled, scaled_next = (data.observations - mean) / std, (data.next_observations - mean) / std
    inputs = torch.from_numpy(np.concatenate([scaled, data.actions], axis=1)).double()
    targets = torch.from_numpy(scaled_next - scaled).double()
    start = train_dynamics(data, replace(config, updates=0), "x").weights
    trained = train_dynamics(data, config, "x").weights
    rng = stream("batches", "x")
    index = np.stack([rng.integers(200, size=(3, 32)) for _ in range(config.updates)])
    for member in range(3):
        layers = [torch.nn.Linear(10, 16), torch.nn.Linear(16, 16), torch.nn.Linear(16, 6)]
        net = torch.nn.Sequential(
            layers[0], torch.nn.ReLU(), layers[1], torch.nn.ReLU(), layers[2]
        ).double()
        for number, layer in enumerate(layers):
            layer.weight.data = torch.from_numpy(start[f"t.w{number}"][member].T).double()
            layer.bias.data = torch.from_numpy(start[f"t.b{number}"][member, 0]).double()
        optimizer = torch.optim.Adam(net.parameters(), lr=config.learning_rate)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, config.updates)
        for update in range(config.updates):
            rows = index[update, member]
            loss = (net(inputs[rows]) - targets[rows]).square().mean() / config.members
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
        for number, layer in enumerate(layers):
            np.testing.assert_allclose(
                trained[f"t.w{number}"][member], layer.weight.T.detach(), atol=1e-4
            )
            assert np.abs(trained[f"t.w{number}"] - start[f"t.w{number}"]).max() > 5e-3


def test_units_of_measurement_do_not_matter() -> None:
    """Powers of two, so that even the rounding is the same: byte for byte."""
    data = explored()
    factors = np.float32(2.0) ** np.array([0, 10, -5, 3, 1, -2], dtype=np.float32)
    stretched = replace(
        data,
        observations=data.observations * factors,
        next_observations=data.next_observations * factors,
    )
    plain, other = (train_dynamics(d, TINY, "x").weights for d in (data, stretched))
    for name in plain:
        if name.startswith("t."):
            assert plain[name].tobytes() == other[name].tobytes(), name
    states, actions = torch.from_numpy(data.observations[:50]), torch.from_numpy(data.actions[:50])
    scale = torch.from_numpy(factors)
    predicted = Dynamics(plain, TINY)(states[None], actions)
    rescaled = Dynamics(other, TINY)(states[None] * scale, actions)
    assert torch.equal(rescaled, predicted * scale)
    assert torch.equal(
        Dynamics(other, TINY).scaled(rescaled), Dynamics(plain, TINY).scaled(predicted)
    )


def test_labels_decide_every_byte() -> None:
    torch.manual_seed(0)
    first = train_dynamics(explored(), TINY, "dynamics", "maze", 0)
    torch.manual_seed(1)
    again = train_dynamics(explored(), TINY, "dynamics", "maze", 0)
    other = train_dynamics(explored(), TINY, "dynamics", "maze", 1)
    assert first.curves == again.curves != other.curves
    for name, array in first.weights.items():
        assert array.tobytes() == again.weights[name].tobytes(), name
        if name.startswith("t."):
            assert array.tobytes() != other.weights[name].tobytes(), name


def test_members_differ() -> None:
    weights = train_dynamics(explored(), TINY, "x").weights
    for name in ("t.w0", "t.b2"):
        assert len(np.unique(weights[name].reshape(TINY.members, -1), axis=0)) == TINY.members


def test_the_loss_falls() -> None:
    config = replace(TINY, updates=200, learning_rate=1e-2, log_every=1)
    curve = train_dynamics(explored(), config, "x").curves["prediction_loss"]
    assert [update for update, _ in curve] == list(range(1, 201))
    losses = [loss for _, loss in curve]
    assert np.mean(losses[-20:]) < 0.5 * np.mean(losses[:5])


@pytest.mark.parametrize("column", ["observations", "actions", "next_observations"])
def test_bad_data_stop_training(column: str) -> None:
    data = explored()
    data.columns()[column][::3] = np.nan
    with pytest.raises(FloatingPointError, match="prediction_loss is nan at update 10"):
        train_dynamics(data, TINY, "x")


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_imagined_sequences_are_one_step_after_another(precision: Precision) -> None:
    config = replace(TINY, precision=precision)
    model = Dynamics(train_dynamics(explored(), config, "maze").weights, config)
    states = seen_from(np.argwhere(MAZE.free)[:6])
    moves = stream("moves").integers(len(MOVES), size=(6, 5))
    sequences = torch.eye(len(MOVES))[torch.from_numpy(moves)]
    stepwise = [states.unsqueeze(0)]
    for actions in sequences.unbind(dim=1):
        stepwise.append(model(stepwise[-1], actions))
    path = model.imagine_path(states, sequences)
    assert path.shape == (TINY.members, 5, 6, MAZE.observation_size)
    tolerance = 1e-5 if precision == "float32" else 1e-2
    torch.testing.assert_close(
        path, torch.stack(stepwise[1:], dim=1), rtol=tolerance, atol=tolerance
    )
    assert torch.equal(model.imagine(states, sequences), path[:, -1])
