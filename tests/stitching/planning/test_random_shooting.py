"""Random shooting: what it draws, and that it keeps the best of it."""

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.planning.random_shooting import RandomShooting

MAZE = ActionSpace(4, discrete=True)
ARM = ActionSpace(9, discrete=False)


def streams(problems: int) -> list[np.random.Generator]:
    return [np.random.Generator(np.random.Philox(key=problem)) for problem in range(problems)]


def drawn(space: ActionSpace, problems: int) -> Tensor:
    """The whole population, as the score sees it."""
    seen = []

    def score(_: Tensor, actions: Tensor) -> Tensor:
        seen.append(actions)
        return torch.zeros(actions.shape[:2])

    RandomShooting().plan(score, streams(problems), space)
    (actions,) = seen
    return actions


def test_discrete_actions_are_uniform_one_hot() -> None:
    actions = drawn(MAZE, 50)
    assert actions.shape == (50, 200, 5, 4)
    assert set(actions.unique().tolist()) == {0.0, 1.0}
    assert (actions.sum(dim=-1) == 1).all()
    # 10,000 draws in each of 5 steps: 0.02 is more than four standard errors.
    torch.testing.assert_close(
        actions.mean(dim=(0, 1)), torch.full((5, 4), 0.25), rtol=0, atol=0.02
    )


def test_continuous_actions_are_uniform_in_the_box() -> None:
    actions = drawn(ARM, 50)
    assert actions.shape == (50, 200, 5, 9)
    quantiles = torch.tensor([0.0, 0.25, 0.5, 0.75, 1.0])
    found = actions[..., 0, 0].flatten().quantile(quantiles)
    torch.testing.assert_close(found, 2 * quantiles - 1, rtol=0, atol=0.04)


def test_finds_the_one_sequence_that_is_asked_for() -> None:
    wanted = torch.nn.functional.one_hot(torch.tensor([0, 3, 1]), 4).float()
    planner = RandomShooting(population=2000, horizon=3)
    plan = planner.plan(lambda _, actions: (actions * wanted).sum(dim=(2, 3)), streams(8), MAZE)
    assert torch.equal(plan.actions, wanted.expand(8, 3, 4))
    assert (plan.objective == 3).all()


def test_ties_go_to_the_first_drawn() -> None:
    first = drawn(MAZE, 3)[:, 0]
    plan = RandomShooting().plan(
        lambda _, actions: torch.zeros(actions.shape[:2]), streams(3), MAZE
    )
    assert torch.equal(plan.actions, first)
