"""CEM: against a plain transcription in numpy, on known optima, and when it stops."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.planning.cem import CEM
from stitching.planning.protocol import Score

SIZE = 2
SPACE = ActionSpace(SIZE, discrete=False)
PLANNER = CEM(population=50, elites=10, horizon=3, iterations=500, tolerance=0.01)
TARGETS = torch.linspace(-0.9, 0.9, 6)


def stream(key: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=key))


def streams(problems: int = len(TARGETS)) -> list[np.random.Generator]:
    return [stream(problem) for problem in range(problems)]


def bowls(problems: Tensor, actions: Tensor) -> Tensor:
    return -(actions - TARGETS[problems, None, None, None]).square().sum(dim=(2, 3))


def plain_bowl(target: float) -> Callable[[np.ndarray], float]:
    return lambda action: -np.sum((action - target) ** 2)


def plain_cem(
    planner: CEM, score: Callable[[np.ndarray], float], stream: np.random.Generator
) -> tuple[np.ndarray, int]:
    """One problem, one sample at a time, in float64."""
    shape = (planner.horizon, SIZE)
    mean, std = np.zeros(shape), np.ones(shape)
    for t in range(planner.iterations):
        samples = []
        for _ in range(planner.population):
            noise = stream.standard_normal(shape, dtype=np.float32).astype(np.float64)
            samples.append(np.clip(mean + std * noise, -1, 1))
        elites = sorted(samples, key=score, reverse=True)[: planner.elites]
        temperature = planner.temperature * planner.temperature_discount**t
        weights = np.exp([(score(a) - score(elites[0])) / temperature for a in elites])
        weights /= weights.sum()
        elite_mean = sum(w * a for w, a in zip(weights, elites, strict=True))
        variance = sum(w * (a - elite_mean) ** 2 for w, a in zip(weights, elites, strict=True))
        variance /= max(1 - sum(w**2 for w in weights), 1e-3)
        mean = planner.momentum * mean + (1 - planner.momentum) * elite_mean
        std = planner.momentum * std + (1 - planner.momentum) * np.sqrt(variance)
        if std.max() < planner.tolerance:
            return mean, t + 1
    return mean, planner.iterations


@pytest.mark.parametrize(
    "planner",
    [
        PLANNER,
        replace(PLANNER, momentum=0.0, iterations=20),
        replace(PLANNER, temperature_discount=1.0, iterations=60),
        replace(PLANNER, temperature=0.01, iterations=60, tolerance=0.0),
        replace(PLANNER, elites=1, iterations=60),
        replace(PLANNER, elites=50, population=50, iterations=60),
    ],
    ids=["paper", "no momentum", "no annealing", "cold", "one elite", "all elite"],
)
def test_agrees_with_a_plain_float64_cem(planner: CEM) -> None:
    plan = planner.plan(bowls, streams(), SPACE)
    for problem, target in enumerate(TARGETS.double().numpy()):
        mean, iterations = plain_cem(planner, plain_bowl(target), stream(problem))
        np.testing.assert_allclose(plan.actions[problem], mean, rtol=0, atol=1e-4)
        assert plan.iterations[problem] == iterations


def test_finds_the_bottom_of_each_bowl() -> None:
    plan = PLANNER.plan(bowls, streams(), SPACE)
    wanted = TARGETS[:, None, None].expand_as(plan.actions)
    torch.testing.assert_close(plan.actions, wanted, rtol=0, atol=0.02)


def test_finds_an_optimum_at_the_bound() -> None:
    corner = torch.tensor([1.0, -1.0])
    plan = PLANNER.plan(lambda _, actions: (actions * corner).sum(dim=(2, 3)), streams(), SPACE)
    torch.testing.assert_close(plan.actions, corner.expand_as(plan.actions), rtol=0, atol=0.02)


def test_prefers_the_higher_of_two_peaks() -> None:
    def peaks(_: Tensor, actions: Tensor) -> Tensor:
        def peak(at: float) -> Tensor:
            return (-8 * (actions - at).square().sum(dim=(2, 3))).exp()

        return 0.7 * peak(-0.6) + peak(0.6)

    planner = CEM(population=200, elites=20, horizon=1, iterations=200, tolerance=0.01)
    plan = planner.plan(peaks, streams(20), SPACE)
    wanted = torch.full_like(plan.actions, 0.6)
    torch.testing.assert_close(plan.actions, wanted, rtol=0, atol=0.03)


def test_a_converged_problem_stops_and_the_rest_go_on() -> None:
    def flat_or_steep(problems: Tensor, actions: Tensor) -> Tensor:
        return bowls(problems, actions) * (1 + 999 * (problems % 2))[:, None]

    def recorded(problems: Tensor, actions: Tensor) -> Tensor:
        asked.append(problems.tolist())
        return flat_or_steep(problems, actions)

    def alone(problem: int) -> Score:
        return lambda _, actions: flat_or_steep(torch.tensor([problem]), actions)

    asked: list[list[int]] = []
    plan = PLANNER.plan(recorded, streams(), SPACE)
    *rounds, final = asked
    assert plan.iterations.unique().numel() > 1
    assert (plan.iterations < PLANNER.iterations).all()
    assert [sum(problem in r for r in rounds) for problem in range(6)] == plan.iterations.tolist()
    assert final == list(range(6))
    for problem in range(6):
        single = PLANNER.plan(alone(problem), [stream(problem)], SPACE)
        torch.testing.assert_close(single.actions[0], plan.actions[problem], rtol=0, atol=1e-6)


def test_the_iteration_limit_is_honoured() -> None:
    plan = replace(PLANNER, iterations=7).plan(bowls, streams(), SPACE)
    assert (plan.iterations == 7).all()


def test_zero_tolerance_never_stops_early() -> None:
    # All weight on one elite and no memory: σ is exactly 0 after the first iteration.
    planner = replace(PLANNER, elites=1, momentum=0.0, tolerance=0.0, iterations=30)
    assert (planner.plan(bowls, streams(), SPACE).iterations == 30).all()


def test_without_momentum_one_elite_is_the_best_sample() -> None:
    planner = replace(PLANNER, elites=1, momentum=0.0, iterations=1)
    noise = stream(0).standard_normal((50, 3, SIZE), dtype=np.float32)
    samples = torch.from_numpy(noise).clamp(-1, 1)
    best = bowls(torch.tensor([0]), samples[None])[0].argmax()
    assert torch.equal(planner.plan(bowls, streams(), SPACE).actions[0], samples[best])


def test_at_zero_temperature_the_best_elite_decides() -> None:
    falling = replace(PLANNER, temperature_discount=1e-300, iterations=40)
    frozen = falling.plan(bowls, streams(), SPACE)
    cold = replace(PLANNER, temperature=1e-300, iterations=40).plan(bowls, streams(), SPACE)
    best = replace(PLANNER, elites=1, iterations=40).plan(bowls, streams(), SPACE)
    assert torch.equal(cold.actions, best.actions)
    assert frozen.actions.isfinite().all()


def test_at_high_temperature_elites_count_equally() -> None:
    planner = replace(PLANNER, temperature=1e6, momentum=0.0, iterations=1)
    noise = stream(0).standard_normal((50, 3, SIZE), dtype=np.float32)
    samples = torch.from_numpy(noise).clamp(-1, 1)
    elites = samples[bowls(torch.tensor([0]), samples[None])[0].argsort(descending=True)[:10]]
    torch.testing.assert_close(planner.plan(bowls, streams(), SPACE).actions[0], elites.mean(dim=0))


def test_scores_too_large_to_divide_by_the_temperature() -> None:
    plan = PLANNER.plan(lambda p, actions: 1e37 * bowls(p, actions), streams(), SPACE)
    assert plan.actions.isfinite().all()


def test_rejects_what_cannot_work() -> None:
    with pytest.raises(ValueError, match="RandomShooting"):
        PLANNER.plan(bowls, streams(), ActionSpace(4, discrete=True))
    with pytest.raises(ValueError, match="elites"):
        replace(PLANNER, elites=51)
    with pytest.raises(ValueError, match="elites"):
        replace(PLANNER, elites=0)


def test_the_first_samples_lie_around_the_plan_that_it_is_given() -> None:
    seen: list[Tensor] = []

    def score(problems: Tensor, actions: Tensor) -> Tensor:
        seen.append(actions)
        return bowls(problems, actions)

    start = torch.full((len(TARGETS), 3, SIZE), 0.4)
    planner = replace(PLANNER, iterations=1, start_std=0.05)
    planner.plan(score, streams(), SPACE, start)
    assert (seen[0].mean(dim=1) - start).abs().max() < 0.03
    assert seen[0].std(dim=1).mean().item() == pytest.approx(0.05, rel=0.1)


def test_without_a_plan_it_starts_at_zero() -> None:
    by_itself = PLANNER.plan(bowls, streams(), SPACE)
    zero = torch.zeros(len(TARGETS), 3, SIZE)
    at_zero = replace(PLANNER, start_std=1.0).plan(bowls, streams(), SPACE, zero)
    assert torch.equal(by_itself.actions, at_zero.actions)
