"""A sweep's winner in a run: `skillstitch run table2 --from-sweep kitchen-search`."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec
from orchestrator.spec.structure import Plain
from orchestrator.spec.tomls import Scale
from orchestrator.storage.rundir import RunDirectory
from sweeps.space import replaced

RUNS = Path("runs")


def find_sweep(name: str) -> Path:
    """A sweep's directory, by its path, or by its name at the largest scale that has a winner."""
    places = [Path(name)]
    places += [RUNS / f"sweep-{name}-{scale}" for scale in reversed(get_args(Scale))]
    for place in places:
        if (place / "winner.json").is_file():
            return place
    if any((place / "sweep.json").is_file() for place in places):
        raise UsageError(f"sweep {name} has no winner yet; the same sweep command goes on with it")
    found = sorted(path.parent.name for path in RUNS.glob("sweep-*/winner.json"))
    raise UsageError(
        f"no sweep {name!r}: neither a directory nor the name of one in {RUNS}/, where there are "
        f"{', '.join(found) or 'none'}"
    )


def with_winner(spec: Spec, name: str) -> Spec:
    """A spec with a sweep's winner as its own setting of MB-Stitch, of its models or its data."""
    path = find_sweep(name)
    winner: Plain = RunDirectory(path).read_json("winner.json")
    if winner["benchmark"] != spec.benchmark:
        raise UsageError(
            f"sweep {name} searched {winner['benchmark']}; {spec.name} is of {spec.benchmark}"
        )
    return replaced(spec, winner["fields"], f"winner of sweep {name}")
