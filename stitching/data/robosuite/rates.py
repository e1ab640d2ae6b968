"""What a setting of the data leaves to stitch: rates of demonstrators and of policies.

    python -m stitching.data.robosuite.rates --task "open door,close door" --data.quality 0.3

Of No-Stitch alone: settings are chosen by these and never by how a stitcher fares on them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import tyro

from stitching.data.experience import skill_experience
from stitching.data.robosuite.demonstrations import RobosuiteDataConfig, collect, starts
from stitching.envs.protocol import conditions, skill_index
from stitching.envs.robosuite.can import CAN, Can
from stitching.envs.robosuite.door import DOOR, Door
from stitching.methods.no_stitch import NoStitch
from stitching.models.agent import Agent
from stitching.models.iql import IQLConfig, train_single_tasks
from stitching.rollout import Block, RolloutConfig, play_from_start, play_segment


@dataclass(frozen=True)
class RatesConfig:
    """How often learned skills succeed from their own starts and at hand-overs: what is tried."""

    task: str = "open door,close door"  # or "can,can"
    data: RobosuiteDataConfig = RobosuiteDataConfig(episodes=60)
    agent: IQLConfig = IQLConfig(width=128, policy_width=256, multi_task=False)
    seeds: int = 2  # trainings; one of them is one draw
    trials: int = 50  # of each rate
    step_limit: int = 50  # of a whole task, and of a skill from its own starts; the cans' is 100


@dataclass(frozen=True)
class Rates:
    """Successes and trials of one training."""

    own: dict[str, tuple[int, int]]  # by skill, from its own starts
    after: tuple[int, int]  # of the second skill, where the first succeeded
    score: float  # No-Stitch's: accomplished skills over the task's two


def policy_rates(
    agent: Agent, benchmark: Door | Can, task: tuple[str, str], config: RatesConfig, seed: int
) -> Rates:
    """From starts that no demonstration had, drawn as each skill's own are; without a stitch."""
    episodes, rollout = tuple(range(config.trials)), RolloutConfig()
    own = {}
    for skill in dict.fromkeys(task):
        block = Block(0, benchmark.name, seed, "", episodes, (skill,))
        env = starts(benchmark, skill_index(benchmark, skill)).vector_env()
        env.reset(block.streams("own starts"))
        budget = np.full(config.trials, config.step_limit)
        segments = play_segment(env, agent, NoStitch(), benchmark, rollout, block, budget)
        own[skill] = int(segments.success.sum()), config.trials
    whole = Block(0, benchmark.name, seed, "", episodes, task)
    outcome = play_from_start(
        benchmark.vector_env(), agent, NoStitch(), benchmark, rollout, whole, config.step_limit
    )
    second = outcome[1].success if len(outcome) > 1 else np.zeros(0, dtype=bool)
    wins, reached = int(second.sum()), len(second)
    return Rates(own, (wins, reached), (reached + wins) / (2 * config.trials))


def lines(config: RatesConfig) -> Iterator[str]:
    """One for the demonstrators, then one for each training as it ends."""
    first, second = config.task.split(",")
    benchmark = CAN if first == CAN.skills[0].name else DOOR
    data = collect(benchmark, config.data, seed=0)
    experience = skill_experience(data, conditions(benchmark))
    demonstrators = {
        skill.name: data.episode_successes[data.episode_skills == index]
        for index, skill in enumerate(benchmark.skills)
    }
    yield "demonstrators: " + ", ".join(
        f"{skill} {success.sum()} of {len(success)}" for skill, success in demonstrators.items()
    )
    for seed in range(config.seeds):
        labels = ("agent", benchmark.name, 0, seed)
        trained = train_single_tasks(experience, benchmark.actions, config.agent, *labels)
        agent = Agent(trained.weights, conditions(benchmark), benchmark.actions)
        rates = policy_rates(agent, benchmark, (first, second), config, seed)
        own = ", ".join(f"{skill} {wins} of {n}" for skill, (wins, n) in rates.own.items())
        met = f"{second} {rates.after[0]} of {rates.after[1]}"
        yield f"seed {seed}: own starts: {own}; hand-over: {met}; score {rates.score:.3f}"


def main(config: RatesConfig) -> None:
    """Print the rates, a line each as it is known."""
    for line in lines(config):
        print(line, flush=True)


if __name__ == "__main__":
    main(tyro.cli(RatesConfig))
