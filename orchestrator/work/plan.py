"""A spec expanded: the artifacts it takes, the rollout tree, and every block's name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil
from typing import Any

from orchestrator.builders.registry import BLOCK_CODE, BLOCK_SETUP
from orchestrator.errors import UsageError
from orchestrator.spec.methods import (
    SHARED,
    first_method,
    method_name,
    method_of,
    method_rollout,
    playing_modules,
    settings_with_effect,
)
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.work.artifacts import Recipes
from orchestrator.work.jobs import BlockTask
from orchestrator.work.recipes import Recipe, canonical, code_fingerprint, digests
from stitching.methods.protocol import MethodSettings
from stitching.rollout import RolloutConfig

Prefix = tuple[str, ...]

MOST_BLOCKS = 10**6  # of a plan, which then takes half a gigabyte of the driver's memory


@dataclass(frozen=True)
class Node:
    """One more skill for the episodes that survived a prefix."""

    seed: int
    method: str  # SHARED for the first skills that methods share
    prefix: Prefix
    parent: Node | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class MethodBlocks:
    """What all blocks of a method have in common."""

    name: str  # of the method without its settings; SHARED likewise
    settings: MethodSettings
    rollout: RolloutConfig
    models: tuple[str, ...]  # kinds of those that they are played with
    code: str  # fingerprint of what plays them

    @classmethod
    def of(cls, spec: Spec, method: str) -> MethodBlocks:
        settings = spec.method_settings(method)
        return cls(
            # Planner streams are named by the kind of method, so that settings of one method are
            # compared under common random numbers.
            method_name(method) if method != SHARED else SHARED,
            settings,
            method_rollout(method, spec.rollout),
            method_of(method).models,
            code_fingerprint(
                tuple(sorted({*BLOCK_CODE, *playing_modules(method, settings)})), BLOCK_SETUP
            ),
        )

    @cached_property
    def named(self) -> Plain:
        """What their keys contain of it."""
        return {
            "settings": settings_with_effect(self.settings),
            "rollout": to_plain(self.rollout),
            "code": self.code,
        }


@dataclass(frozen=True)
class Plan:
    """Artifacts in an order in which they can be made, and the tree of nodes, parents first."""

    spec: Spec
    recipes: dict[str, Recipe]  # by key
    models: dict[tuple[str, int, str], str]  # (kind, seed, method played with it) → key
    datasets: dict[str, str]  # role → key
    illustrations: dict[str, str]  # name → key
    nodes: tuple[Node, ...]

    @cached_property
    def scored_kinds(self) -> set[str]:
        """Kinds of the artifacts that scores depend on, which illustrations are not among."""
        return {self.recipes[key].kind for key in (*self.models.values(), *self.datasets.values())}

    def by_seed(self, kind: str) -> dict[int, str]:
        """Keys of the models of a kind that all methods share; empty where none needs them."""
        return {seed: key for (one, seed, _), key in self.models.items() if one == kind}

    @cached_property
    def chunks(self) -> list[tuple[int, int]]:
        """Episode ranges of a node's blocks."""
        size, total = self.spec.block_episodes, self.spec.episodes
        return [(first, min(first + size, total)) for first in range(0, total, size)]

    @cached_property
    def tasks(self) -> dict[tuple[Node, int], BlockTask]:
        """Every block by node and chunk, parents first."""
        chunks = [(episodes, canonical(episodes)) for episodes in self.chunks]
        return {
            (node, chunk): task
            for node in self.nodes
            for chunk, task in enumerate(self._tasks(node, chunks))
        }

    @cached_property
    def children(self) -> dict[Node, list[Node]]:
        following: dict[Node, list[Node]] = {}
        for node in self.nodes:
            if node.parent is not None:
                following.setdefault(node.parent, []).append(node)
        return following

    @property
    def needed(self) -> set[str]:
        """Artifacts that the numbers depend on: all but what is only looked at."""
        models = set(self.models.values())
        return models.union(*(self.recipes[key].inputs.values() for key in models))

    def first_method(self, method: str) -> str:
        """In whose name a method's first skills are played: its own, or SHARED."""
        return first_method(method, self.spec.rollout)

    def roots(self) -> Iterator[Node]:
        return (node for node in self.nodes if node.parent is None)

    @cached_property
    def method_blocks(self) -> dict[str, MethodBlocks]:
        """By method: a paper's table has a hundred thousand blocks, and few methods."""
        methods = dict.fromkeys(node.method for node in self.nodes)
        return {method: MethodBlocks.of(self.spec, method) for method in methods}

    def task(self, node: Node, chunk: int) -> BlockTask:
        """One block, without naming all others."""
        episodes = self.chunks[chunk]
        return next(self._tasks(node, [(episodes, canonical(episodes))]))

    def _tasks(self, node: Node, chunks: list[tuple[tuple[int, int], str]]) -> Iterator[BlockTask]:
        """A node's blocks of these episodes, which names contain as the text beside them."""
        alike = self.method_blocks[node.method]
        place: dict[str, Any] = {
            "benchmark": self.spec.benchmark,
            "root_seed": self.spec.root_seed,
            "seed": node.seed,
            "method": alike.name,
            "prefix": node.prefix,
            "step_limit": self.spec.step_limit,
            "artifacts": {kind: self.models[kind, node.seed, node.method] for kind in alike.models},
        }
        keys = digests(place | alike.named, "episodes", (text for _, text in chunks))
        for key, (episodes, _) in zip(keys, chunks, strict=True):
            yield BlockTask(
                key=key,
                episodes=episodes,
                settings=alike.settings,
                rollout=alike.rollout,
                **place,
            )


def make_plan(spec: Spec) -> Plan:
    """Expand a spec. Pure: looks at neither store nor ledger.

    Raises UsageError where there would be more blocks than memory is meant to hold.
    """
    _check_size(spec)
    recipes = Recipes(spec)
    recipes.add_datasets()
    recipes.add_models()
    recipes.add_illustrations()
    return Plan(
        spec,
        recipes.by_key,
        recipes.models,
        recipes.datasets | recipes.long_horizon,
        recipes.illustrations,
        tuple(node for seed in range(spec.seeds) for node in _nodes(spec, seed)),
    )


def _check_size(spec: Spec) -> None:
    blocks = len(_nodes(spec, 0)) * spec.seeds * ceil(spec.episodes / spec.block_episodes)
    if blocks > MOST_BLOCKS:
        raise UsageError(
            f"spec {spec.name}: {blocks:,} blocks, and a plan holds at most {MOST_BLOCKS:,}; ask "
            "for larger block_episodes, or for fewer episodes, seeds, methods or tasks"
        )


def _nodes(spec: Spec, seed: int) -> list[Node]:
    """Every prefix of every task, parents first, each once."""
    nodes: dict[tuple[str, Prefix], Node] = {}
    tasks = spec.all_tasks
    for depth in range(1, max(map(len, tasks)) + 1):
        for method in spec.methods:
            first = first_method(method, spec.rollout)
            player = method if depth > 1 else first
            above = method if depth > 2 else first
            for task in tasks:
                place = player, task[:depth]
                if len(task) >= depth and place not in nodes:
                    parent = nodes[above, task[: depth - 1]] if depth > 1 else None
                    nodes[place] = Node(seed, *place, parent)
    return list(nodes.values())
