"""What is known of trainings while they go on: how far they are, and how far the whole is."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from orchestrator.storage.store import Store
from orchestrator.work.checkpoints import News, news_of
from orchestrator.work.costs import training_seconds
from orchestrator.work.progress import UnderWay
from orchestrator.work.recipes import Recipe
from stitching.data.mixtures import skill_pairs


@dataclass
class Trainings:
    """Of artifacts that are made side by side, for a person.

    Trainings whose checkpoints are not seen from here tell nothing until they have ended.
    """

    store: Store
    recipes: Mapping[str, Recipe]  # by key
    skills: int  # of the benchmark
    _since: float = field(default_factory=time.time)
    _before: dict[str, tuple[float, int]] = field(default_factory=dict)  # when, how many updates

    @cached_property
    def _seconds(self) -> dict[str, float]:
        return training_seconds(self.recipes, self.store)

    def under_way(self, finished: Iterable[str], begun: Iterable[str]) -> UnderWay:
        """Of all recipes: `finished` are there; `begun` are not, but being made."""
        done = sum(self._seconds.get(key, 0.0) for key in finished)
        lines = []
        for key in sorted(begun):
            news = news_of(self.store.checkpoint_folder(key), self._since)
            if news is not None:
                updates = self._updates(key, news)
                lines.append(self._told(key, news, updates))
                done += self._seconds[key] * min(1.0, news.done / updates)
        whole = sum(self._seconds.values())
        return UnderWay("; ".join(lines), min(1.0, done / whole) if whole else None)

    def _updates(self, key: str, news: News) -> int:
        """Of all trainings of an artifact: those that have not begun are as long as the others."""
        recipe = self.recipes[key]
        if recipe.params.get("config", {}).get("multi_task", True):
            return news.updates
        each = {"agent": self.skills, "mf-policy": len(skill_pairs(self.skills))}
        return max(news.updates, each.get(recipe.kind, 1) * news.updates // news.trainings)

    def _told(self, key: str, news: News, updates: int) -> str:
        recipe, now = self.recipes[key], time.monotonic()
        seed = f", seed {recipe.params['seed']}" if "seed" in recipe.params else ""
        line = f"{recipe.kind}{seed}: {news.done:,} of {updates:,} updates"
        then, done = self._before.setdefault(key, (now, news.done))
        if news.done > done:
            line += f" ({(news.done - done) / (now - then):.0f}/s)"
        elif news.done < done:  # another attempt
            self._before[key] = now, news.done
        losses = [f"{name} {value:.3g}" for name, value in news.losses.items()]
        return ", ".join([line, *losses[:1]])
