"""What each benchmark brings along: its data's settings, its datasets, and what figures need."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestrator.errors import UsageError
from orchestrator.structure import Plain
from stitching.data.kitchen.demonstrations import KitchenDataConfig, Order, orders
from stitching.data.maze import MazeDataConfig
from stitching.data.robosuite.demonstrations import RobosuiteDataConfig

DataConfig = MazeDataConfig | KitchenDataConfig | RobosuiteDataConfig

TEACHING = "every dataset that teaches"  # among an illustration's inputs


@dataclass(frozen=True)
class Dataset:
    """One artifact of transitions; dynamics are learned from all, skills from those that teach."""

    kind: str
    params: Plain = field(default_factory=dict)  # beside the data's settings and the root seed
    teaches: bool = True


@dataclass(frozen=True)
class Illustration:
    """Something to look at that no score depends on, made last and by seed 0's models."""

    kind: str
    inputs: tuple[str, ...]  # "agent", "dynamics", TEACHING, or roles of datasets and of `extras`
    task: tuple[str, ...] = ()  # played in it, where the spec has it; empty: none is
    pairs: int = 0  # at most, of skills that follow one another in the spec's tasks
    episodes: int = 0  # at most, of each such pair


@dataclass(frozen=True)
class Costs:
    """What work costs where a store has no history yet: on one core of a 2-core cloud machine."""

    update: dict[str, float]  # s of training, by kind of model
    demonstration: dict[str, float] = field(default_factory=dict)  # s each, by kind of dataset
    whole: dict[str, float] = field(default_factory=dict)  # s of other artifacts, by kind
    planned_segment: float = 0.0  # s, of a method that plans
    segment: float = 0.0  # s, of the others
    success: float = 0.5  # of a skill
    segment_bytes: int = 0


@dataclass(frozen=True)
class Kit:
    data: type[DataConfig]
    datasets: Callable[[Any], dict[str, Dataset]]  # by role, for these settings
    costs: Costs
    extras: dict[str, str] = field(default_factory=dict)  # data not learned from: role → kind
    for_extras: tuple[str, ...] = ()  # settings of the data that no dataset learned from depends on
    illustrations: dict[str, Illustration] = field(default_factory=dict)  # by name
    long_horizon: Callable[[Any], str] = lambda config: ""  # kind of Single-Policy's data, if any
    label: Callable[[Any], str] = lambda config: ""  # of unusual data; every table shows it


def _maze_datasets(config: MazeDataConfig) -> dict[str, Dataset]:
    return {
        "demonstrations": Dataset("maze-demonstrations"),
        "exploration": Dataset("maze-exploration", teaches=False),
    }


def _kitchen_datasets(config: KitchenDataConfig) -> dict[str, Dataset]:
    """One artifact an order, so that they are collected in parallel."""
    if config.source == "human":
        if config.human.endswith(".npz") and not Path(config.human).is_file():
            raise UsageError(f"data.human: no file {config.human}")
        if not config.human:
            raise UsageError(
                "data.human: name an .npz file or a Minari dataset, as D4RL/kitchen/complete-v2"
            )
        return {"demonstrations": Dataset("kitchen-human", {"sha256": _sha256(config.human)})}
    return {
        f"demonstrations-{short_order(order)}": Dataset("kitchen-demonstrations", {"order": order})
        for order in orders(config)
    }


def _kitchen_long_horizon(config: KitchenDataConfig) -> str:
    """People's recordings do not hold any one task often enough."""
    return "" if config.source == "human" else "kitchen-long-horizon"


def _kitchen_label(config: KitchenDataConfig) -> str:
    return {
        "orders": "",
        "single-skill": "data: each skill alone, from the start pose",
        "human": f"data: people's demonstrations, {Path(config.human).name}",
    }[config.source]


def short_order(order: Order) -> str:
    """ "microwave-bottom-top-slide": as the human orders are written."""
    return "-".join(name.split()[0] for name in order)


def _sha256(file: str) -> str:
    """Of a local file, so that another content is another dataset; hub ids name one content."""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest() if Path(file).is_file() else ""


def _physics_illustrations(
    family: str, task: tuple[str, ...], pairs: int, episodes: int
) -> dict[str, Illustration]:
    """A task played step by step, models judged by the role "held-out", stitches taken apart."""
    return {
        "showcase": Illustration(f"{family}-showcase", ("agent", "dynamics"), task),
        "diagnosis": Illustration(f"{family}-diagnosis", ("agent", "dynamics", "held-out")),
        "anatomy": Illustration(
            f"{family}-anatomy", ("agent", "dynamics", TEACHING), pairs=pairs, episodes=episodes
        ),
    }


def _robosuite_kit(*task: str) -> Kit:
    return Kit(
        RobosuiteDataConfig,
        lambda config: {"demonstrations": Dataset("robosuite-demonstrations")},
        Costs(
            update={"agent": 0.03, "mf-policy": 0.01, "dynamics": 0.01},
            demonstration={"robosuite-demonstrations": 0.6, "robosuite-held-out": 0.6},
            whole={
                "robosuite-anatomy": 150.0,
                "robosuite-diagnosis": 60.0,
                "robosuite-showcase": 60.0,
            },
            planned_segment=4.0,
            segment=0.6,
            success=0.5,
            segment_bytes=1000,
        ),
        extras={"held-out": "robosuite-held-out"},
        for_extras=("held_out",),
        illustrations=_physics_illustrations("robosuite", task, pairs=1, episodes=30),
    )


KITS: dict[str, Kit] = {
    "maze": Kit(
        MazeDataConfig,
        _maze_datasets,
        Costs(
            update={"agent": 0.005, "mf-policy": 0.003, "dynamics": 0.005},
            planned_segment=0.005,
            segment=0.003,
            success=0.9,
            segment_bytes=120,
        ),
        illustrations={
            "showcase": Illustration(
                "maze-showcase",
                ("agent", "dynamics", "demonstrations"),
                task=("g0", "g1", "g3", "g2"),  # the paper's Figure 1
            )
        },
    ),
    "kitchen": Kit(
        KitchenDataConfig,
        _kitchen_datasets,
        Costs(
            update={
                "agent": 0.022,
                "mf-policy": 0.011,
                "single-policy": 0.011,
                "dynamics": 0.008,
            },
            demonstration={
                "kitchen-demonstrations": 0.8,
                "kitchen-long-horizon": 0.6,
                "kitchen-held-out": 15.0,
            },
            whole={
                "kitchen-anatomy": 300.0,
                "kitchen-diagnosis": 120.0,
                "kitchen-showcase": 60.0,
            },
            planned_segment=1.6,
            segment=0.26,
            success=0.3,
            segment_bytes=1300,
        ),
        extras={"held-out": "kitchen-held-out"},
        for_extras=("held_out",),
        illustrations=_physics_illustrations(
            "kitchen",
            ("microwave", "kettle", "bottom burner", "hinge cabinet"),
            pairs=20,
            episodes=6,
        ),
        long_horizon=_kitchen_long_horizon,
        label=_kitchen_label,
    ),
    "robosuite-door": _robosuite_kit("open door", "close door"),
    "robosuite-can": _robosuite_kit("can", "can"),
}
