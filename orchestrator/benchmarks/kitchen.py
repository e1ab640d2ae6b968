"""What is to be known of Kitchen."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from orchestrator.benchmarks.entry import BenchmarkEntry, Costs, Dataset, physics_illustrations
from orchestrator.benchmarks.own_data import own_dataset, own_label
from orchestrator.builders.kitchen import KITCHEN_BUILDERS
from orchestrator.builders.long_horizon import LONG_HORIZON_BUILDERS
from orchestrator.builders.studies import Studies
from stitching.data.kitchen.demonstrations import KitchenDataConfig, orders
from stitching.data.kitchen.segments import Order
from stitching.envs.kitchen import GROUPS, KITCHEN
from stitching.studies.showcase.physics import StepRecorder


def _datasets(config: KitchenDataConfig) -> dict[str, Dataset]:
    """One artifact an order, so that they are collected in parallel."""
    if config.are_own:
        setting = "data.file" if config.file else "data.human"
        return own_dataset("kitchen-own-data", config.own, setting)
    return {
        f"demonstrations-{short_order(order)}": Dataset("kitchen-demonstrations", {"order": order})
        for order in orders(config)
    }


def _long_horizon(config: KitchenDataConfig) -> str:
    """People's recordings do not hold any one task often enough."""
    return "" if config.are_own else "kitchen-long-horizon"


def _label(config: KitchenDataConfig) -> str:
    return (
        own_label(config)
        or {
            "orders": "",
            "single-skill": "data: each skill alone, from the start pose",
            "human": f"data: people's demonstrations, {Path(config.human).name}",
        }[config.source]
    )


def short_order(order: Order) -> str:
    """ "microwave-bottom-top-slide": as the human orders are written."""
    return "-".join(name.split()[0] for name in order)


STUDIES = Studies("kitchen", {KITCHEN.name: KITCHEN}, GROUPS, foretells=True)

KITCHEN_ENTRY = BenchmarkEntry(
    KITCHEN,
    KitchenDataConfig,
    _datasets,
    KITCHEN_BUILDERS | LONG_HORIZON_BUILDERS | STUDIES.builders,
    Costs(
        demonstration={
            "kitchen-demonstrations": 0.8,
            "kitchen-long-horizon": 0.6,
            "kitchen-held-out": 15.0,
        },
        whole={
            "kitchen-stitches": 300.0,
            "kitchen-diagnosis": 120.0,
            "kitchen-showcase": 60.0,
        },
        segment=0.26,
        plans=1.1,
        success=0.3,
        segment_bytes=1300,
    ),
    extras={"held-out": "kitchen-held-out"},
    for_extras=("held_out",),
    illustrations=physics_illustrations(
        "kitchen",
        ("microwave", "kettle", "bottom burner", "hinge cabinet"),
        pairs=20,
        episodes=6,
    ),
    recorder=partial(StepRecorder, KITCHEN),
    long_horizon=_long_horizon,
    label=_label,
)
