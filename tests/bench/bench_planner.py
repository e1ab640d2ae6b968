"""Plans per second of CEM at the paper's Kitchen setting: a block at once against one by one.

Planner as in Table 7; models with random weights, their sizes ours (the paper gives none).
Iterations to convergence depend on the scores, so trained models will take their own number.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.layers import Params, init_mlp, mlp
from stitching.planning.cem import CEM
from stitching.planning.objective import conservative_value
from stitching.planning.protocol import PlannedActions, Planner
from tests.bench.result import Result, alternate

MEMBERS, WIDTH, OBSERVATION, ACTION = 5, 256, 59, 9
ALPHA, BETA = 7.0, 5.0  # Table 7, Kitchen
ARM = ActionSpace(ACTION, discrete=False)
KITCHEN = CEM()  # Table 7


@dataclass(frozen=True)
class KitchenScore:
    """Eq. 2 at the end of each action sequence, every dynamics member on its own trajectory."""

    dynamics: Params
    value: Params
    states: Tensor  # (problems, observation)

    def __call__(self, problems: Tensor, actions: Tensor) -> Tensor:
        open_problems, population, horizon, _ = actions.shape
        sequences = actions.flatten(0, 1)
        start = self.states[problems].repeat_interleave(population, dim=0)
        states = start.expand(MEMBERS, -1, -1)
        for step in range(horizon):
            action = sequences[:, step].expand(MEMBERS, -1, -1)
            states = states + mlp(self.dynamics, torch.cat([states, action], dim=-1), "elu")
        values = mlp(self.value, states.mean(dim=0))[..., 0]
        return conservative_value(values, states, ALPHA, BETA).view(open_problems, population)


def random_score(problems: int) -> KitchenScore:
    rng = np.random.default_rng(0)
    return KitchenScore(
        init_mlp(MEMBERS, [OBSERVATION + ACTION, WIDTH, WIDTH, OBSERVATION], rng),
        init_mlp(MEMBERS, [OBSERVATION, WIDTH, WIDTH, 1], rng),
        torch.from_numpy(rng.standard_normal((problems, OBSERVATION), dtype=np.float32)),
    )


def streams(problems: range) -> list[np.random.Generator]:
    return [np.random.Generator(np.random.Philox(key=problem)) for problem in problems]


def in_blocks(planner: Planner, score: KitchenScore, block: int) -> Iterator[PlannedActions]:
    for first in range(0, len(score.states), block):
        of_block = replace(score, states=score.states[first : first + block])
        yield planner.plan(of_block, streams(range(first, first + block)), ARM)


def measure() -> Iterator[Result]:
    yield from _compare("to convergence", KITCHEN, problems=4, blocks=(4,), repetitions=1)
    rounds = replace(KITCHEN, tolerance=0.0, iterations=10)
    yield from _compare("10 iterations", rounds, problems=16, blocks=(4, 16), repetitions=3)


def _compare(
    setting: str, planner: CEM, problems: int, blocks: tuple[int, ...], repetitions: int
) -> Iterator[Result]:
    """Plan the same problems one by one, and so many at once as each of the blocks says."""
    score = random_score(problems)
    with torch.inference_mode():
        one_by_one, *at_once = alternate(
            repetitions,
            *(lambda block=block: list(in_blocks(planner, score, block)) for block in (1, *blocks)),
        )
    for block, seconds in zip(blocks, at_once, strict=True):
        yield Result(
            "planner",
            f"Kitchen, CEM {setting}: {block} problems at once over one by one",
            {"plans/s at once": problems / seconds, "one by one": problems / one_by_one},
            ratio=one_by_one / seconds,
        )
