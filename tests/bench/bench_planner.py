"""Plans per second of CEM at the paper's Kitchen setting: a block at once against one by one.

    python -m tests.bench.bench_planner

Planner as in Table 7; models with random weights, their sizes ours (the paper gives none). Read the
ratios: they compare timings of one run on one core, while plans per second depend on the machine.
Iterations to convergence depend on the scores, so trained models will take their own number.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import torch
from torch import Tensor

from stitching.envs.protocol import ActionSpace
from stitching.models.layers import Params, init_mlp, mlp
from stitching.planning.cem import CEM
from stitching.planning.objective import conservative_value
from stitching.planning.protocol import Plan, Planner

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


def in_blocks(planner: Planner, score: KitchenScore, block: int) -> Iterator[Plan]:
    for first in range(0, len(score.states), block):
        of_block = replace(score, states=score.states[first : first + block])
        yield planner.plan(of_block, streams(range(first, first + block)), ARM)


def compare(planner: CEM, problems: int, blocks: tuple[int, ...]) -> None:
    """One line for each number of problems planned at once; the first is the ratio's unit."""
    score = random_score(problems)
    unit = None
    print(f"{'at once':>10}{'plans/s':>10}{'ratio':>8}{'iterations':>12}{'objective':>12}")
    for block in blocks:
        began = perf_counter()
        with torch.inference_mode():
            plans = list(in_blocks(planner, score, block))
        rate = problems / (perf_counter() - began)
        unit = unit or rate
        iterations = torch.cat([plan.iterations for plan in plans]).double().mean()
        objective = torch.cat([plan.objective for plan in plans]).mean()
        print(f"{block:>10}{rate:>10.3f}{rate / unit:>8.2f}{iterations:>12.1f}{objective:>12.4f}")
    print()


def main() -> None:
    torch.set_num_threads(1)
    to_the_end = replace(KITCHEN, tolerance=0.0)
    print("4 problems, until convergence")
    compare(KITCHEN, 4, (1, 4))
    print("4 problems, all 500 iterations")
    compare(to_the_end, 4, (1, 4))
    print("32 problems, 10 iterations")
    compare(replace(to_the_end, iterations=10), 32, (1, 8, 32))


if __name__ == "__main__":
    main()
