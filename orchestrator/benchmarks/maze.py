"""What is to be known of the maze."""

from __future__ import annotations

from orchestrator.benchmarks.entry import BenchmarkEntry, Costs, Dataset, Illustration
from orchestrator.benchmarks.own_data import own_dataset, own_label
from orchestrator.builders.maze import MAZE_BUILDERS
from orchestrator.builders.studies import maze_showcase_builder
from stitching.data.maze import MazeDataConfig
from stitching.envs.maze import MAZE
from stitching.studies.showcase.maze import PathRecorder


def _datasets(config: MazeDataConfig) -> dict[str, Dataset]:
    if config.file:
        return own_dataset("maze-own-data", config.file)
    return {
        "demonstrations": Dataset("maze-demonstrations"),
        "exploration": Dataset("maze-exploration", for_training=False),
    }


MAZE_ENTRY = BenchmarkEntry(
    MAZE,
    MazeDataConfig,
    _datasets,
    MAZE_BUILDERS | {"maze-showcase": maze_showcase_builder(MAZE)},
    Costs(
        segment=0.003,
        plans=0.3,
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
    recorder=lambda agent: PathRecorder(MAZE),
    label=own_label,
)
