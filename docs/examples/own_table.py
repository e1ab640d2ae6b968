"""A table of one's own: two tasks, two prices of disagreement, other demonstrations."""

import sys
from dataclasses import replace
from pathlib import Path

from analysis import open_run
from orchestrator import load_spec, reproduce
from stitching.data.maze import MazeDataConfig

where = Path(sys.argv[1] if len(sys.argv) > 1 else "example-runs")

spec = replace(
    load_spec("table1", scale="smoke"),
    name="two-tasks",
    title="Two tasks, by the price of disagreement",
    lengths=(),
    tasks=("g0>g2", "g2>g0"),
    methods=("no-stitch", "mb-stitch[alpha=0]", "mb-stitch[alpha=20]"),
    data=MazeDataConfig(episodes=20, noise=0.1),  # a clumsier demonstrator
)
spec = replace(spec, tables=(replace(spec.tables[0], id="two-tasks", paper="", rows="task"),))

# In this process alone, without Ray: a debugger sees everything.
directory = reproduce(
    spec, where / "two-tasks", store=where / "store", executor="serial", tracking_uri="none"
)
print(open_run(directory).scores()[["row", "method", "score", "ci_low", "ci_high"]])
