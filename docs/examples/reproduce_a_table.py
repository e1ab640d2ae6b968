"""Reproduce a table at smoke scale, which takes half a minute, and read it with pandas."""

import sys
from pathlib import Path

from analysis import open_run
from orchestrator import load_spec, plan, reproduce

where = Path(sys.argv[1] if len(sys.argv) > 1 else "example-runs")

spec = load_spec("table1", scale="smoke")
print(f"{len(spec.all_tasks)} tasks, {len(plan(spec).tasks)} blocks at most")

directory = reproduce(spec, where / "table1", store=where / "store", tracking_uri="none")

run = open_run(directory)
print(run.scores("table1")[["row", "method", "score", "ci_low", "ci_high"]])
print(run.gains("table1")[["row", "method", "baseline", "gain"]])

# Whatever the tables do not say is in the episodes: here, how many steps a success takes.
done = run.episodes[run.episodes["score"] == 1]
print(done.groupby(["method", "length"])["steps"].mean())
