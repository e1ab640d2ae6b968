"""IQL: its equations in plain float64, whole training runs, and a problem whose answer is known."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import expectile as scipy_expectile
from scipy.stats import norm
from torch import Tensor, nn

from stitching.data.corrections import Corrections
from stitching.data.experience import Experience, skill_experience
from stitching.data.swapping import Swapping
from stitching.data.transitions import DataError, Transitions
from stitching.envs.factors import NO_OBJECT
from stitching.envs.protocol import ActionSpace
from stitching.models.agent import Agent
from stitching.models.iql import IQLConfig, minibatches, train_iql, train_single_tasks
from stitching.models.layers import Params, init_mlp, named, parameters
from stitching.models.losses import (
    LOG_STD_RANGE,
    MAX_ADVANTAGE_WEIGHT,
    Batch,
    expectile_loss,
    iql_losses,
)
from stitching.models.scale import observation_scale
from stitching.streams import stream

MEMBERS, STATE, ACTION, ROWS = 3, 5, 4, 12
CONFIG = IQLConfig(
    updates=30,
    batch_size=16,
    dropout=0.0,
    learning_rate=1e-3,
    tau=0.3,
    members=MEMBERS,
    width=8,
    log_every=10,
)
SPACES = {
    "discrete": ActionSpace(ACTION, discrete=True),
    "continuous": ActionSpace(ACTION, discrete=False),
}
KINDS = pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
GENERATOR = torch.Generator()


# The equations, one transition and one member at a time.


def plain(params: Params, member: int, inputs: np.ndarray) -> np.ndarray:
    hidden = np.maximum(inputs @ params["w0"][member].numpy() + params["b0"][member, 0].numpy(), 0)
    return hidden @ params["w1"][member].numpy() + params["b1"][member, 0].numpy()


def plain_log_probability(
    outputs: np.ndarray, log_std: np.ndarray, action: np.ndarray, discrete: bool
) -> float:
    if discrete:
        return outputs[np.argmax(action)] - np.log(np.exp(outputs).sum())
    std = np.exp(np.clip(log_std, *LOG_STD_RANGE))
    return norm.logpdf(action, np.tanh(outputs), std).sum()


def plain_losses(
    nets: dict[str, Params], log_std: Tensor, batch: Batch, config: IQLConfig, discrete: bool
) -> dict[str, float]:
    nets = {name: {k: w.double() for k, w in net.items()} for name, net in nets.items()}
    value_losses, q_losses, policy_losses, weights, values = [], [], [], [], []
    for row in range(ROWS):
        s, a, s_next = (
            t[row].double().numpy() for t in (batch.inputs, batch.actions, batch.next_inputs)
        )
        sa = np.concatenate([s, a])
        advantages = []
        for member in range(MEMBERS):
            pair = (2 * member, 2 * member + 1)
            q_slow = min(plain(nets["q_target"], i, sa)[0] for i in pair)
            v = plain(nets["v"], member, s)[0]
            u = q_slow - v
            value_losses.append(abs(config.expectile - (u < 0)) * u**2)
            y = batch.rewards[row].item()
            if batch.continues[row]:
                y += config.gamma * plain(nets["v"], member, s_next)[0]
            q_losses += [(plain(nets["q"], i, sa)[0] - y) ** 2 for i in pair]
            advantages.append(u)
            values.append(v)
        weights.append(min(np.exp(config.temperature * np.mean(advantages)), MAX_ADVANTAGE_WEIGHT))
        log_probability = plain_log_probability(
            plain(nets["policy"], 0, s), log_std.double().numpy(), a, discrete
        )
        policy_losses.append(-weights[-1] * log_probability)
    assert min(weights) < MAX_ADVANTAGE_WEIGHT == max(weights)  # both sides of the clip are tried
    by_row = np.reshape(values, (ROWS, MEMBERS))
    return {
        "value_loss": np.mean(value_losses),
        "q_loss": np.mean(q_losses),
        "policy_loss": np.mean(policy_losses),
        "mean_value": by_row.mean(),
        "value_disagreement": by_row.std(axis=1).mean(),
    }


def networks(seed: int = 0) -> dict[str, Params]:
    nets = {
        "q": init_mlp(2 * MEMBERS, [STATE + ACTION, 8, 1], stream("q", seed)),
        "q_target": init_mlp(2 * MEMBERS, [STATE + ACTION, 8, 1], stream("slow", seed)),
        "v": init_mlp(MEMBERS, [STATE, 8, 1], stream("v", seed)),
        "policy": init_mlp(1, [STATE, 8, ACTION], stream("policy", seed)),
    }
    nets["q_target"]["w1"] *= 20  # advantages of both signs, some large enough to be clipped
    nets["q_target"]["b1"] += 3
    return nets


def batch_of(space: ActionSpace, seed: int = 0) -> Batch:
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> Tensor:
        return torch.from_numpy(rng.standard_normal(shape, dtype=np.float32))

    return Batch(
        inputs=normal(ROWS, STATE),
        actions=torch.from_numpy(space.uniform(rng, (ROWS,))),
        next_inputs=normal(ROWS, STATE),
        rewards=normal(ROWS),
        continues=torch.from_numpy((rng.random(ROWS) < 0.6).astype(np.float32)),
    )


LOG_STD = torch.tensor([0.3, -1.0, 2.5, -6.0])  # the last two are out of range


@KINDS
@pytest.mark.parametrize("expectile", [0.5, 0.7, 0.95])
def test_losses_are_the_equations(space: ActionSpace, expectile: float) -> None:
    config = replace(CONFIG, expectile=expectile, temperature=3.0)
    nets, batch = networks(), batch_of(space)
    losses = iql_losses(**nets, log_std=LOG_STD, batch=batch, config=config,
                        discrete=space.discrete, generator=GENERATOR)  # fmt: skip
    expected = plain_losses(nets, LOG_STD, batch, config, space.discrete)
    assert losses.keys() == expected.keys()
    for name, value in expected.items():
        assert losses[name].item() == pytest.approx(value, rel=1e-4), name


@KINDS
def test_each_loss_moves_its_own_parameters(space: ActionSpace) -> None:
    """One backward pass serves all three; none may leak into another's network."""
    nets, log_std = networks(), LOG_STD.clone()
    for parameter in (log_std, *(w for net in nets.values() for w in net.values())):
        parameter.requires_grad_()
    losses = iql_losses(**nets, log_std=log_std, batch=batch_of(space), config=CONFIG,
                        discrete=space.discrete, generator=GENERATOR)  # fmt: skip
    for loss, owner in (("value_loss", "v"), ("q_loss", "q"), ("policy_loss", "policy")):
        for name, net in nets.items():
            gradients = torch.autograd.grad(
                losses[loss], list(net.values()), retain_graph=True, allow_unused=True
            )
            assert all((gradient is not None) == (name == owner) for gradient in gradients)


@KINDS
def test_nothing_is_bootstrapped_beyond_a_terminal(space: ActionSpace) -> None:
    nets, batch = networks(), batch_of(space)

    def q_loss(continues: float, next_inputs: Tensor) -> float:
        changed = replace(batch, continues=torch.full((ROWS,), continues), next_inputs=next_inputs)
        losses = iql_losses(**nets, log_std=LOG_STD, batch=changed, config=CONFIG,
                            discrete=space.discrete, generator=GENERATOR)  # fmt: skip
        return losses["q_loss"].item()

    elsewhere = batch.next_inputs + 1
    assert q_loss(0, batch.next_inputs) == q_loss(0, elsewhere)
    assert q_loss(1, batch.next_inputs) != q_loss(1, elsewhere)


def test_dropout_is_for_the_policy_alone() -> None:
    space, nets = SPACES["discrete"], networks()

    def losses(dropout: float, seed: int) -> dict[str, Tensor]:
        generator = torch.Generator().manual_seed(seed)
        return iql_losses(**nets, log_std=LOG_STD, batch=batch_of(space),
                          config=replace(CONFIG, dropout=dropout), discrete=True,
                          generator=generator)  # fmt: skip

    without, once, again = losses(0.0, 0), losses(0.3, 0), losses(0.3, 1)
    assert once["policy_loss"] != again["policy_loss"]
    assert without["policy_loss"] not in (once["policy_loss"], again["policy_loss"])
    for name in ("value_loss", "q_loss"):
        assert without[name] == once[name] == again[name]


@pytest.mark.parametrize("level", [0.1, 0.5, 0.7, 0.99])
def test_the_minimiser_of_the_expectile_loss_is_the_expectile(level: float) -> None:
    sample = np.random.default_rng(0).exponential(size=200)
    minimum = float(scipy_expectile(sample, level))

    def slope(at: float) -> float:
        m = torch.tensor(at, dtype=torch.float64, requires_grad=True)
        expectile_loss(torch.from_numpy(sample) - m, level).mean().backward()
        assert m.grad is not None
        return m.grad.item()

    assert slope(minimum) == pytest.approx(0, abs=1e-6)
    assert slope(minimum - 0.1) < 0 < slope(minimum + 0.1)


def test_the_middle_expectile_is_the_mean() -> None:
    difference = torch.linspace(-2, 2, 9)
    assert torch.equal(expectile_loss(difference, 0.5), 0.5 * difference.square())


# Whole training runs, against plain networks, one optimiser each, in float64.


def experience_of(space: ActionSpace, rows: int = 40, seed: int = 0) -> Experience:
    rng = np.random.default_rng(seed)
    observations = rng.normal(3, 2, (rows + 1, 3)).astype(np.float32)
    data = Transitions(
        observations=observations[:-1],
        actions=space.uniform(rng, (rows,)),
        next_observations=observations[1:],
        episode_ends=np.arange(5, rows + 1, 5),
        episode_skills=np.arange(rows // 5) % 2,
        episode_successes=np.arange(rows // 5) % 3 > 0,
    )
    return skill_experience(data, np.eye(2, dtype=np.float32))


def module(weights: dict[str, np.ndarray], prefix: str, member: int) -> nn.Sequential:
    """One member as a plain float64 torch network."""
    layers: list[nn.Module] = []
    for layer in range(CONFIG.hidden_layers + 1):
        w = torch.from_numpy(weights[f"{prefix}.w{layer}"][member]).double()
        linear = nn.Linear(w.shape[0], w.shape[1], dtype=torch.float64)
        linear.weight.data = w.T.clone()
        linear.bias.data = torch.from_numpy(weights[f"{prefix}.b{layer}"][member, 0]).double()
        layers += [linear, nn.ReLU()]
    return nn.Sequential(*layers[:-1])


class PlainIQL:
    """The authors' training loop for one ensemble member after the other."""

    def __init__(self, weights: dict[str, np.ndarray], config: IQLConfig, discrete: bool) -> None:
        self.config, self.discrete = config, discrete
        self.q = [module(weights, "q", i) for i in range(2 * MEMBERS)]
        self.slow = [module(weights, "q", i) for i in range(2 * MEMBERS)]
        self.v = [module(weights, "v", m) for m in range(MEMBERS)]
        self.policy = module(weights, "policy", 0)
        self.log_std = nn.Parameter(torch.zeros(ACTION, dtype=torch.float64))
        critics = [p for net in (*self.q, *self.v) for p in net.parameters()]
        self.critic = torch.optim.Adam(critics, lr=config.learning_rate)
        self.actor = torch.optim.Adam(
            [*self.policy.parameters(), self.log_std], lr=config.learning_rate
        )
        self.schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self.actor, config.updates)

    def update(self, batch: Batch) -> None:
        config = self.config
        s, s_next = batch.inputs.double(), batch.next_inputs.double()
        sa = torch.cat([s, batch.actions.double()], dim=1)
        loss, advantages = torch.zeros((), dtype=torch.float64), []
        for m in range(MEMBERS):
            pair = (2 * m, 2 * m + 1)
            q_slow = torch.minimum(*(self.slow[i](sa)[:, 0].detach() for i in pair))
            u = q_slow - self.v[m](s)[:, 0]
            asymmetry = torch.where(u > 0, config.expectile, 1 - config.expectile)
            loss = loss + (asymmetry * u**2).mean() / MEMBERS
            y = batch.rewards + config.gamma * batch.continues * self.v[m](s_next)[:, 0].detach()
            for i in pair:
                loss = loss + ((self.q[i](sa)[:, 0] - y) ** 2).mean() / (2 * MEMBERS)
            advantages.append(u.detach())
        weight = (config.temperature * torch.stack(advantages).mean(0)).exp().clamp(max=100)
        outputs = self.policy(s)
        if self.discrete:
            policy = torch.distributions.Categorical(logits=outputs)
            log_probability = policy.log_prob(batch.actions.argmax(1))
        else:
            gaussian = torch.distributions.Normal(outputs.tanh(), self.log_std.exp())
            log_probability = gaussian.log_prob(batch.actions.double()).sum(1)
        for optimizer, objective in (
            (self.critic, loss),
            (self.actor, -(weight * log_probability).mean()),
        ):
            optimizer.zero_grad()
            objective.backward()
            optimizer.step()
        if config.learning_rate_decay:
            self.schedule.step()
        with torch.no_grad():
            for slow, fast in zip(self.slow, self.q, strict=True):
                for old, new in zip(slow.parameters(), fast.parameters(), strict=True):
                    old.copy_((1 - config.tau) * old + config.tau * new)

    def weights(self) -> dict[str, list[Tensor]]:
        groups = {"q": self.q, "v": self.v, "policy": [self.policy]}
        named: dict[str, list[Tensor]] = {"policy.log_std": [self.log_std]}
        for prefix, nets in groups.items():
            members = [[layer for layer in net if isinstance(layer, nn.Linear)] for net in nets]
            for number, layers in enumerate(zip(*members, strict=True)):
                named[f"{prefix}.w{number}"] = [layer.weight.T for layer in layers]
                named[f"{prefix}.b{number}"] = [layer.bias[None] for layer in layers]
        return named


def batches_of(experience: Experience, config: IQLConfig, *labels: str) -> Iterator[Batch]:
    mean, std = observation_scale(experience.data.observations)
    return minibatches(experience, mean, std, config.batch_size, stream("batches", *labels))


@KINDS
@pytest.mark.parametrize("decay", [True, False], ids=["decay", "constant rate"])
def test_training_is_the_plain_loop(space: ActionSpace, decay: bool) -> None:
    config = replace(CONFIG, learning_rate_decay=decay)
    experience = experience_of(space)
    start = train_iql(experience, space, replace(config, updates=0), "x").weights
    reference = PlainIQL(start, config, space.discrete)
    batches = batches_of(experience, config, "x")
    for _ in range(config.updates):
        reference.update(next(batches))
    trained = train_iql(experience, space, config, "x").weights
    for name, members in reference.weights().items():
        expected = torch.stack([w.detach() for w in members]).numpy()
        np.testing.assert_allclose(
            trained[name], expected.reshape(trained[name].shape), atol=2e-4, err_msg=name
        )
        if name != "policy.log_std" or not space.discrete:
            assert np.abs(trained[name] - start[name]).max() > 2e-3, name


@KINDS
def test_the_policy_leaves_no_trace_in_the_critics(space: ActionSpace) -> None:
    """So settings of the policy alone can be compared at equal values."""
    experience = experience_of(space)
    base = train_iql(experience, space, CONFIG, "x").weights
    for change in ({"dropout": 0.2}, {"temperature": 9.0}, {"learning_rate_decay": False}):
        other = train_iql(experience, space, replace(CONFIG, **change), "x").weights
        for name in base:
            same = base[name].tobytes() == other[name].tobytes()
            assert same == (not name.startswith("policy.")) or name == "policy.log_std", name


@KINDS
def test_labels_decide_every_byte(space: ActionSpace) -> None:
    config = replace(CONFIG, dropout=0.1)
    experience = experience_of(space)
    torch.manual_seed(0)
    first = train_iql(experience, space, config, "agent", "maze", 0)
    torch.manual_seed(1)
    state = torch.get_rng_state()
    again = train_iql(experience, space, config, "agent", "maze", 0)
    assert torch.equal(torch.get_rng_state(), state)
    other = train_iql(experience, space, config, "agent", "maze", 1)
    assert first.curves == again.curves != other.curves
    for name, array in first.weights.items():
        assert array.tobytes() == again.weights[name].tobytes(), name
        if name.startswith(("q.", "v.", "policy.w")):
            assert array.tobytes() != other.weights[name].tobytes(), name


@KINDS
def test_a_skill_by_itself_learns_from_nothing_else(space: ActionSpace) -> None:
    """Other skills' rewards do not matter; a skill that nobody shows is named."""
    experience = experience_of(space)
    own = experience.condition_ids == 1
    other = replace(experience, rewards=np.where(own, experience.rewards, 1 - experience.rewards))
    first, second = (train_single_tasks(one, space, CONFIG, "x") for one in (experience, other))
    assert {name.partition(".")[0] for name in first.weights} == {"0", "1"}
    same = {name for name, w in first.weights.items() if np.array_equal(w, second.weights[name])}
    assert {name for name in first.weights if name.startswith("1.")} <= same
    assert "0.v.w0" not in same
    alone = train_iql(experience.of(1), space, CONFIG, "x", 1)
    assert all(np.array_equal(w, first.weights[f"1.{n}"]) for n, w in alone.weights.items())
    with pytest.raises(DataError, match="nothing of skill 1"):
        replace(experience, condition_ids=np.zeros_like(own, dtype=np.int64)).of(1)


@KINDS
def test_a_policy_goes_on_from_another_and_the_values_do_not(space: ActionSpace) -> None:
    experience, untrained = experience_of(space), replace(CONFIG, updates=0)
    taught = train_iql(experience, space, CONFIG, "x").weights
    before = {name: array.copy() for name, array in taught.items()}
    fresh = train_iql(experience, space, untrained, "y").weights
    for config in (untrained, CONFIG):
        start = parameters(taught, "policy")
        tuned = train_iql(experience, space, config, "y", policy_from=start).weights
        moved = {n for n in tuned if n.startswith("policy.") and (tuned[n] != taught[n]).any()}
        assert bool(moved) == (config is CONFIG)
        if config is untrained:
            assert all(np.array_equal(tuned[n], fresh[n]) for n in fresh if n[:2] in ("q.", "v."))
    assert all(np.array_equal(taught[name], array) for name, array in before.items())


def test_each_condition_goes_on_from_its_own_policy() -> None:
    space = SPACES["continuous"]
    experience, untrained = experience_of(space), replace(CONFIG, updates=0)
    taught = train_single_tasks(experience, space, CONFIG, "x").weights
    starts = [parameters(named(taught, skill), "policy") for skill in ("1", "0")]
    tuned = train_single_tasks(experience, space, untrained, "y", policies_from=starts).weights
    for condition, start in enumerate(starts):
        for name, tensor in start.items():
            assert np.array_equal(tuned[f"{condition}.policy.{name}"], tensor)


def test_members_learn_apart() -> None:
    weights = train_iql(experience_of(SPACES["discrete"]), SPACES["discrete"], CONFIG, "x").weights
    for name, count in (("v.w0", MEMBERS), ("q.w0", 2 * MEMBERS)):
        assert len(np.unique(weights[name].reshape(count, -1), axis=0)) == count


def test_curves_are_logged_as_often_as_asked() -> None:
    experience, space = experience_of(SPACES["discrete"]), SPACES["discrete"]
    curves = train_iql(experience, space, replace(CONFIG, updates=25), "x").curves
    assert {len(curve) for curve in curves.values()} == {3}
    assert [update for update, _ in curves["q_loss"]] == [10, 20, 25]


@pytest.mark.parametrize("column", ["observations", "next_observations", "actions"])
def test_bad_data_stop_training(column: str) -> None:
    space = SPACES["continuous"]
    experience = experience_of(space)
    experience.data.columns()[column][7] = np.nan
    with pytest.raises(FloatingPointError, match=r"diverged: .* at update 10"):
        train_iql(experience, space, CONFIG, "x")


def test_minibatches_hold_matching_rows_and_cover_the_experience() -> None:
    space = SPACES["discrete"]
    experience = experience_of(space)
    mean, std = observation_scale(experience.data.observations)
    known = {}
    for k, row in enumerate(experience.rows):
        condition = experience.conditions[experience.condition_ids[k]]
        scaled = (experience.data.observations[row] - mean) / std
        scaled_next = (experience.data.next_observations[row] - mean) / std
        known[scaled.tobytes()] = (
            np.concatenate([scaled, condition]).tobytes(),
            experience.data.actions[row].tobytes(),
            np.concatenate([scaled_next, condition]).tobytes(),
            experience.rewards[k],
            1 - experience.terminals[k],
        )
    batches, seen = batches_of(experience, CONFIG, "x"), set()
    for _ in range(30):
        batch = next(batches)
        assert batch.inputs.shape == (CONFIG.batch_size, STATE)
        for i in range(CONFIG.batch_size):
            key = batch.inputs[i, :3].numpy().tobytes()
            assert known[key] == (
                batch.inputs[i].numpy().tobytes(),
                batch.actions[i].numpy().tobytes(),
                batch.next_inputs[i].numpy().tobytes(),
                batch.rewards[i].item(),
                batch.continues[i].item(),
            )
            seen.add(key)
    assert len(seen) == len(experience.rows)


# A corridor: from cell to cell to the right, where a step out of the last one earns 1 and ends.

LENGTH, GAMMA, LEFT, RIGHT = 6, 0.9, 0, 1
CORRIDOR = ActionSpace(2, discrete=True)
EXPECTILES = LOW, HIGH = 0.7, 0.98
SHARE_RIGHT = 0.45  # of the data's moves: to imitate them would be wrong
CHAIN = IQLConfig(
    updates=1200,
    batch_size=64,
    learning_rate=2e-3,
    tau=0.1,
    gamma=GAMMA,
    temperature=10.0,
    dropout=0.0,
    members=2,
    width=32,
)


def corridor() -> Transitions:
    """Noisy walks to the end. Success leads back to cell 0: only the terminal hides its value."""
    rng = np.random.default_rng(0)
    before, moves, after, ends = [], [], [], []
    for _ in range(150):
        cell = int(rng.integers(LENGTH))
        while cell < LENGTH:
            move = RIGHT if rng.random() < SHARE_RIGHT else LEFT
            target = max(cell - 1, 0) if move == LEFT else cell + 1
            before.append(cell)
            moves.append(move)
            after.append(target % LENGTH)
            cell = target
        ends.append(len(before))
    cells, actions = np.eye(LENGTH, dtype=np.float32), np.eye(2, dtype=np.float32)
    return Transitions(
        observations=cells[before],
        actions=actions[moves],
        next_observations=cells[after],
        episode_ends=np.array(ends),
        episode_skills=np.zeros(len(ends), dtype=np.int64),
        episode_successes=np.ones(len(ends), dtype=bool),
    )


@pytest.fixture(scope="module")
def walkers() -> dict[float, Agent]:
    """Trained agents by expectile."""
    conditions = np.ones((1, 1), dtype=np.float32)
    experience = skill_experience(corridor(), conditions)
    agents = {}
    for expectile in EXPECTILES:
        config = replace(CHAIN, expectile=expectile)
        trained = train_iql(experience, CORRIDOR, config, "corridor")
        agents[expectile] = Agent(trained.weights, conditions, CORRIDOR)
    return agents


def fixed_point(expectile: float) -> np.ndarray:
    """V of every cell by dynamic programming on the data: what IQL converges to."""
    data = corridor()
    cells, moves = data.observations.argmax(axis=1), data.actions.argmax(axis=1)
    V = np.zeros(LENGTH)
    for _ in range(100):
        left, right = GAMMA * V[[0, *range(LENGTH - 1)]], np.append(GAMMA * V[1:], 1.0)
        Q = np.stack([left, right], axis=1)
        V = np.array([scipy_expectile(Q[c, moves[cells == c]], expectile) for c in range(LENGTH)])
    return V


@pytest.mark.parametrize("expectile", EXPECTILES)
def test_values_are_the_fixed_point_of_the_expectile_backup(
    walkers: dict[float, Agent], expectile: float
) -> None:
    values = walkers[expectile].values(torch.eye(LENGTH), 0)
    expected = np.tile(fixed_point(expectile), (CHAIN.members, 1))
    np.testing.assert_allclose(values, expected, atol=0.05)


def test_a_high_expectile_gives_gamma_to_the_steps_still_needed(
    walkers: dict[float, Agent],
) -> None:
    values = walkers[HIGH].values(torch.eye(LENGTH), 0)
    steps = np.arange(LENGTH, 0, -1)
    expected = np.tile(GAMMA ** (steps - 1), (CHAIN.members, 1))
    np.testing.assert_allclose(values, expected, atol=0.05)
    assert np.abs(walkers[LOW].values(torch.eye(LENGTH), 0) - expected).max() > 0.05


@pytest.mark.parametrize("expectile", EXPECTILES)
def test_the_policy_goes_the_right_way(walkers: dict[float, Agent], expectile: float) -> None:
    actions = walkers[expectile].act(torch.eye(LENGTH), 0, None)
    assert actions.argmax(axis=1).tolist() == [RIGHT] * LENGTH


def test_swapped_objects_are_the_same_in_both_states_and_others_as_they_were() -> None:
    experience = experience_of(SPACES["continuous"])
    mean, std = observation_scale(experience.data.observations)
    owned = np.array([NO_OBJECT, 0, 1])
    free = np.tile([True, False], (len(experience.data), 1))
    left = (np.array([], dtype=np.int64),) * 2
    swapping = Swapping(share=1.0, object_of=owned, bystanders=free, left=left)

    def first_batch(swapping: Swapping | None) -> Batch:
        return next(minibatches(experience, mean, std, 200, stream("swaps"), swapping))

    plain, swapped = first_batch(None), first_batch(swapping)
    untouched = [0, 2, 3, 4]  # the robot, the object that plays a part, the condition
    for before, after in ((plain.inputs, swapped.inputs), (plain.next_inputs, swapped.next_inputs)):
        assert torch.equal(before[:, untouched], after[:, untouched])
    moved = (plain.inputs[:, 1] != swapped.inputs[:, 1]).numpy()
    assert moved.mean() == pytest.approx(0.5, abs=0.1)
    alike = swapped.inputs[:, 1] == swapped.next_inputs[:, 1]
    assert alike[moved].all()
    assert (alike | (plain.next_inputs[:, 1] == swapped.next_inputs[:, 1])).all()
    seen = (experience.data.observations[:, 1] - mean[1]) / std[1]
    assert np.isin(swapped.inputs[:, 1].numpy(), seen).all()
    assert torch.equal(plain.rewards, swapped.rewards)


def test_half_of_the_swapped_objects_are_as_a_demonstration_left_them() -> None:
    experience = experience_of(SPACES["continuous"])
    data = experience.data
    mean, std = observation_scale(data.observations)
    owned = np.array([NO_OBJECT, 0, NO_OBJECT])
    free, last = np.ones((len(data), 1), dtype=bool), data.episode_ends[-1:] - 1
    swapping = Swapping(share=1.0, object_of=owned, bystanders=free, left=(last,))
    plain = next(minibatches(experience, mean, std, 400, stream("swaps"), None)).inputs[:, 1]
    swapped = next(minibatches(experience, mean, std, 400, stream("swaps"), swapping)).inputs[:, 1]
    left = float((data.next_observations[last[0], 1] - mean[1]) / std[1])
    assert left not in (data.observations[:, 1] - mean[1]) / std[1]
    assert (swapped == left).float().mean().item() == pytest.approx(0.25, abs=0.06)
    assert (swapped != plain).float().mean().item() == pytest.approx(0.5, abs=0.08)


def test_a_displaced_robot_takes_its_corrected_action_to_another_next_state() -> None:
    experience = experience_of(SPACES["continuous"])
    data = experience.data
    mean, std = observation_scale(data.observations)
    corrections = Corrections(
        deviations=np.array([0.5]),
        pose=np.array([0]),
        robot=np.array([0, 1]),
        drift=np.array([[-0.1], [0.3]]),
        effect=np.array([[0.2, 0, 0, 0], [0, 0.1, 0, 0]]),
        back=np.array([[1.0], [0.5], [0], [0]]),
        free=np.ones(len(data), dtype=bool),
        size=data.observations.shape[1],
    )
    # The same transitions: the first draw from the stream is theirs.
    batches = [
        next(minibatches(experience, mean, std, 200, stream("displaced"), None, each))
        for each in (None, corrections)
    ]
    plain, displaced = batches
    away = (displaced.inputs - plain.inputs)[:, 0].numpy() * std[0]
    assert (away != 0).mean() == pytest.approx(0.5, abs=0.1)
    assert torch.equal(plain.inputs[:, 1:], displaced.inputs[:, 1:])
    change = (displaced.actions - plain.actions).numpy()
    expected = np.clip(plain.actions.numpy() - away[:, None] @ [[1 / 3, 1 / 6, 0, 0]], -1, 1)
    assert change[away != 0] == pytest.approx(
        (expected - plain.actions.numpy())[away != 0], abs=1e-5
    )
    assert not change[away == 0].any()
    further = (displaced.next_inputs - plain.next_inputs)[:, :3].numpy() * std
    assert further[:, 0] == pytest.approx(0.9 * away + 0.2 * change[:, 0], abs=1e-5)
    assert further[:, 1] == pytest.approx(0.3 * away + 0.1 * change[:, 1], abs=1e-5)
    assert not further[:, 2].any()
    assert torch.equal(plain.rewards, displaced.rewards)
    assert torch.equal(plain.continues, displaced.continues)


def test_clipping_changes_nothing_of_what_is_learned_and_keeps_the_range() -> None:
    experience, actions = experience_of(SPACES["continuous"]), SPACES["continuous"]
    config = IQLConfig(updates=3, width=8, batch_size=16)
    free = train_iql(experience, actions, config, "clip").weights
    held = train_iql(experience, actions, replace(config, clip=True), "clip").weights
    seen = np.concatenate([experience.data.observations, experience.data.next_observations])
    assert np.array_equal(held.pop("observation_low"), seen.min(axis=0))
    assert np.array_equal(held.pop("observation_high"), seen.max(axis=0))
    assert held.keys() == free.keys()
    assert all(np.array_equal(held[name], free[name]) for name in free)
