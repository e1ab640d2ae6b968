"""What a benchmark brings along: its data's settings, its datasets, and what figures need."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.builders.parts import Builder
from orchestrator.spec.structure import Plain
from stitching.bounds import Bounded
from stitching.envs.protocol import Benchmark
from stitching.models.agent import Agent
from stitching.studies.showcase.recorder import EpisodeRecorder

TRAINING_DATA = "every dataset that skills are learned from"  # among an illustration's inputs


@dataclass(frozen=True)
class Dataset:
    """One artifact of transitions: dynamics are learned from all, skills from some."""

    kind: str
    params: Plain = field(default_factory=dict)  # beside the data's settings and the root seed
    for_training: bool = True  # skills are learned from it


@dataclass(frozen=True)
class Illustration:
    """Something to look at that no score depends on, made last and by seed 0's models."""

    kind: str
    inputs: tuple[str, ...]  # kinds of models, TRAINING_DATA, or roles of datasets and `extras`
    task: tuple[str, ...] = ()  # played in it, where the spec has it; empty: none is
    pairs: int = 0  # at most, of skills that follow one another in the spec's tasks
    episodes: int = 0  # at most, of each such pair


@dataclass(frozen=True)
class Costs:
    """What work costs where a store has no history yet: on one core of a 2-core cloud machine.

    Trainings and plans are counted from their settings (orchestrator.costs.effort).
    """

    demonstration: dict[str, float] = field(default_factory=dict)  # s each, by kind of dataset
    whole: dict[str, float] = field(default_factory=dict)  # s of other artifacts, by kind
    segment: float = 0.0  # s, of a segment without plans
    plans: float = 1.0  # full ones in a segment that stitches until a value falls
    success: float = 0.5  # of a skill
    segment_bytes: int = 0


@dataclass(frozen=True)
class BenchmarkEntry:
    """All that is to be known of a benchmark beside how it is stepped."""

    benchmark: Benchmark
    data: type[Bounded]  # a frozen dataclass with defaults
    datasets: Callable[[Any], dict[str, Dataset]]  # by role, for these settings
    builders: Mapping[str, Builder]  # of its datasets and illustrations, by kind
    costs: Costs
    extras: dict[str, str] = field(default_factory=dict)  # data not learned from: role → kind
    for_extras: tuple[str, ...] = ()  # settings of the data that no dataset learned from depends on
    illustrations: dict[str, Illustration] = field(default_factory=dict)  # by name
    recorder: Callable[[Agent], EpisodeRecorder] | None = None  # of an episode, for films
    long_horizon: Callable[[Any], str] = lambda config: ""  # kind of Single-Policy's data, if any
    label: Callable[[Any], str] = lambda config: ""  # of unusual data; every table shows it


def physics_illustrations(
    family: str, task: tuple[str, ...], pairs: int, episodes: int
) -> dict[str, Illustration]:
    """A task played step by step, models judged by the role "held-out", stitches taken apart."""
    return {
        "showcase": Illustration(f"{family}-showcase", ("agent", "dynamics"), task),
        "diagnosis": Illustration(f"{family}-diagnosis", ("agent", "dynamics", "held-out")),
        "stitches": Illustration(
            f"{family}-stitches",
            ("agent", "dynamics", TRAINING_DATA),
            pairs=pairs,
            episodes=episodes,
        ),
    }
