"""How often the demonstrators succeed: from the start pose, and in the human orders.

    python -m stitching.data.kitchen.rates --attempts 50

Wanted are 90 % from the start pose and 75 % from the ends met in the orders.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import tyro

from stitching.data.kitchen.demonstrations import KitchenDataConfig, human_orders, play
from stitching.data.kitchen.segments import Segment
from stitching.envs.kitchen import SKILLS


@dataclass(frozen=True)
class RatesConfig:
    """How often each skill's program succeeds: what is tried."""

    attempts: int = 50  # of each skill from the start pose
    episodes: int = 4  # demonstrations of each human order
    steps: int = 120  # in which a skill has to be done
    quality: float = KitchenDataConfig.quality
    return_home: bool = KitchenDataConfig.return_home
    seed: int = 1


Attempts = dict[tuple[str, str], list[int]]


def success_rates(config: RatesConfig) -> Attempts:
    """Steps taken by each attempt, 0 where it missed, by (state met, skill).

    States met are "start", the start pose, and the names of the skills just done in the human
    orders. There the attempts that another skill's miss prevented are not counted.
    """
    data = KitchenDataConfig(
        quality=config.quality, skill_steps=config.steps, return_home=config.return_home
    )
    alone = replace(data, episodes=config.attempts)
    attempts: Attempts = {}

    def record(before: str, segment: Segment) -> None:
        steps = len(segment) if segment.success else 0
        attempts.setdefault((before, SKILLS[segment.skill]), []).append(steps)

    for skill in SKILLS:
        for segments in play(alone, (skill,), config.seed):
            for segment in segments[:1]:
                record("start", segment)
    for order in human_orders() if config.episodes else ():
        together = replace(data, episodes=config.episodes)
        for segments in play(together, order, config.seed):
            for before, segment in pairwise(segments):
                record(SKILLS[before.skill], segment)
    return attempts


def summary(attempts: Attempts) -> str:
    """One line a skill and state met: successes of attempts, mean steps of the successes."""
    lines = []
    for skill in SKILLS:
        own = {before: steps for (before, name), steps in attempts.items() if name == skill}
        met = [steps for before, each in own.items() if before != "start" for steps in each]
        for before, steps in {**own, "all ends": met}.items():
            done = [count for count in steps if count]
            mean = f"{np.mean(done):.0f} steps" if done else "-"
            lines.append(f"{skill:14} from {before:14} {len(done):4} of {len(steps):4}  {mean}")
    return "\n".join(lines)


def main(config: RatesConfig) -> None:
    """Print the rates as a table."""
    print(summary(success_rates(config)))


if __name__ == "__main__":
    main(tyro.cli(RatesConfig))
