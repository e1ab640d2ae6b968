"""What is to be known of robosuite's benchmarks."""

from __future__ import annotations

from functools import partial

from orchestrator.benchmarks.entry import BenchmarkEntry, Costs, Dataset, physics_illustrations
from orchestrator.benchmarks.own_data import own_dataset, own_label
from orchestrator.builders.robosuite import ROBOSUITE_BUILDERS
from orchestrator.builders.studies import Studies
from stitching.data.robosuite.demonstrations import RobosuiteDataConfig
from stitching.envs.protocol import Benchmark
from stitching.envs.robosuite.can import CAN
from stitching.envs.robosuite.door import DOOR
from stitching.envs.robosuite.vector_env import GROUPS
from stitching.studies.showcase.physics import StepRecorder

STUDIES = Studies("robosuite", {DOOR.name: DOOR, CAN.name: CAN}, GROUPS)


def _datasets(config: RobosuiteDataConfig) -> dict[str, Dataset]:
    if config.file:
        return own_dataset("robosuite-own-data", config.file)
    return {"demonstrations": Dataset("robosuite-demonstrations")}


def _entry(benchmark: Benchmark, *task: str) -> BenchmarkEntry:
    return BenchmarkEntry(
        benchmark,
        RobosuiteDataConfig,
        _datasets,
        ROBOSUITE_BUILDERS | STUDIES.builders,
        Costs(
            demonstration={"robosuite-demonstrations": 0.6, "robosuite-held-out": 0.6},
            whole={
                "robosuite-stitches": 150.0,
                "robosuite-diagnosis": 60.0,
                "robosuite-showcase": 60.0,
            },
            segment=0.6,
            plans=3.2,
            success=0.5,
            segment_bytes=1000,
        ),
        extras={"held-out": "robosuite-held-out"},
        for_extras=("held_out",),
        illustrations=physics_illustrations("robosuite", task, pairs=1, episodes=30),
        recorder=partial(StepRecorder, benchmark),
        label=own_label,
    )


DOOR_ENTRY = _entry(DOOR, "open door", "close door")
CAN_ENTRY = _entry(CAN, "can", "can")
