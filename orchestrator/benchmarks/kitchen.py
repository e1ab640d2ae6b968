"""What is to be known of Kitchen."""

from __future__ import annotations

import hashlib
from functools import partial
from pathlib import Path

from orchestrator.benchmarks.entry import BenchmarkEntry, Costs, Dataset, physics_illustrations
from orchestrator.builders.kitchen import KITCHEN_BUILDERS
from orchestrator.builders.long_horizon import LONG_HORIZON_BUILDERS
from orchestrator.builders.studies import Studies
from orchestrator.errors import UsageError
from stitching.data.kitchen.demonstrations import KitchenDataConfig, orders
from stitching.data.kitchen.human import recordings_at
from stitching.data.kitchen.segments import Order
from stitching.envs.kitchen import GROUPS, KITCHEN
from stitching.studies.showcase.physics import StepRecorder


def _datasets(config: KitchenDataConfig) -> dict[str, Dataset]:
    """One artifact an order, so that they are collected in parallel."""
    if config.source == "human":
        return {"demonstrations": Dataset("kitchen-human", {"sha256": _sha256(config.human)})}
    return {
        f"demonstrations-{short_order(order)}": Dataset("kitchen-demonstrations", {"order": order})
        for order in orders(config)
    }


def _long_horizon(config: KitchenDataConfig) -> str:
    """People's recordings do not hold any one task often enough."""
    return "" if config.source == "human" else "kitchen-long-horizon"


def _label(config: KitchenDataConfig) -> str:
    return {
        "orders": "",
        "single-skill": "data: each skill alone, from the start pose",
        "human": f"data: people's demonstrations, {Path(config.human).name}",
    }[config.source]


def short_order(order: Order) -> str:
    """ "microwave-bottom-top-slide": as the human orders are written."""
    return "-".join(name.split()[0] for name in order)


def _sha256(source: str) -> str:
    """Of people's recordings, so that another content is another dataset, whatever its name.

    Raises UsageError where there is none.
    """
    if not source:
        raise UsageError(
            "data.human: name an .npz file or a Minari dataset, as D4RL/kitchen/complete-v2"
        )
    place = recordings_at(source)
    if source.endswith(".npz") and not place.is_file():
        raise UsageError(f"data.human: no file {source}")
    if not place.exists():
        raise UsageError(
            f"data.human: no Minari dataset at {place}; fetch it with `minari download {source}`, "
            "or set MINARI_DATASETS_PATH to where it is"
        )
    files = [place] if place.is_file() else sorted(p for p in place.rglob("*") if p.is_file())
    total = hashlib.sha256()
    for file in files:
        total.update(str(file.relative_to(place)).encode())
        with file.open("rb") as content:
            total.update(hashlib.file_digest(content, "sha256").digest())
    return total.hexdigest()


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
