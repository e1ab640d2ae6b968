"""A simulated rollout tree whose true means are known: tasks with a common prefix share it.

Skills succeed with rates of their node (prefix), as near 0 and 1 as policies without noise make
them. How well the first skill went stays with the episode in all that follows it.
"""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.stats import norm

from analysis.statistics import Scores

AFTER_FIRST = 0.7  # how much an episode's luck in its first skill moves all later ones
LUCK, LUCK_WEIGHTS = np.polynomial.hermite_e.hermegauss(31)


@dataclass(frozen=True)
class Tree:
    """One seed's models: how easily each node's skill succeeds, by depth."""

    skills: int
    ease: tuple[np.ndarray, ...]  # depth → (nodes,), on the scale of a normal distribution

    @classmethod
    def grow(cls, rng: np.random.Generator, skills: int, length: int) -> "Tree":
        """One of many possible trees, over all ordered tasks of this length."""
        nodes = np.cumprod(np.arange(skills, skills - length, -1))
        return cls(skills, tuple(rng.normal(0.3, 1.5, size) for size in nodes))

    def retrained(self, rng: np.random.Generator, effect: float) -> "Tree":
        """The same tree by another seed: all nodes move together, and each by itself."""
        common = rng.normal(0, effect)
        return Tree(
            self.skills,
            tuple(ease + common + rng.normal(0, effect, len(ease)) for ease in self.ease),
        )

    @property
    def tasks(self) -> tuple[str, ...]:
        return tuple(">".join(t) for t in permutations("abcdefg"[: self.skills], len(self.ease)))

    def mean(self) -> float:
        """The true mean score over all tasks, for these models."""
        alive = np.ones((1, len(LUCK)))
        total = 0.0
        for depth, ease in enumerate(self.ease):
            alive = np.repeat(alive, self.skills - depth, axis=0)
            alive = alive * norm.cdf(ease[:, None] + (AFTER_FIRST * LUCK if depth else 0))
            total += float((alive @ LUCK_WEIGHTS).mean() / LUCK_WEIGHTS.sum())
        return total / len(self.ease)

    def play(self, rng: np.random.Generator, episodes: int, methods: int = 1) -> list[np.ndarray]:
        """(T, E) scores of methods that are equally good, and share their first skills."""
        first = rng.random((self.skills, episodes)) < norm.cdf(self.ease[0])[:, None]
        luck = AFTER_FIRST * rng.normal(size=first.shape)
        return [self._play_on(rng, first, luck) for _ in range(methods)]

    def _play_on(self, rng: np.random.Generator, alive: np.ndarray, luck: np.ndarray) -> np.ndarray:
        accomplished = alive.astype(float)
        for depth, ease in enumerate(self.ease[1:], start=1):
            below = self.skills - depth
            alive, luck, accomplished = (
                np.repeat(grown, below, axis=0) for grown in (alive, luck, accomplished)
            )
            alive = alive & (rng.random(alive.shape) < norm.cdf(ease[:, None] + luck))
            accomplished += alive
        return accomplished / len(self.ease)


def scores_of(trees: list[Tree], rng: np.random.Generator, episodes: int) -> Scores:
    """What one method did under these seeds."""
    return Scores(np.array([tree.play(rng, episodes)[0] for tree in trees]), trees[0].tasks)


def differences_of(trees: list[Tree], rng: np.random.Generator, episodes: int) -> Scores:
    """One method over another that is just as good."""
    pairs = [tree.play(rng, episodes, methods=2) for tree in trees]
    return Scores(np.array([first - second for first, second in pairs]), trees[0].tasks)
