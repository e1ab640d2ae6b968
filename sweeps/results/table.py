"""A grid's points and No-Stitch as one run, so that they are tabled like any other methods."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from analysis.report import build_report
from analysis.schema import PROVENANCE, SPEC
from orchestrator.spec.spec import Spec
from orchestrator.storage.claim import describe
from orchestrator.storage.exports import write_readable
from orchestrator.storage.provenance import provenance
from orchestrator.storage.rundir import RunDirectory
from orchestrator.work.plan import make_plan
from sweeps.candidates import NO_STITCH, group
from sweeps.player import SpecPlayer
from sweeps.search import search_spec
from sweeps.spec import SweepSpec


def table_spec(sweep: SweepSpec) -> Spec:
    """All of a grid as one run spec; UsageError where it changes models, not only the method."""
    base = search_spec(sweep)
    (one, *others) = group(sweep.points, base, f"sweep {sweep.name}")
    assert not others, "check_sweep refuses tables of grids over models"
    own = [method for method in one.spec.methods if method != NO_STITCH]
    return replace(
        one.spec,
        name=sweep.name,
        title=sweep.title,
        methods=(NO_STITCH, *own),
        tables=sweep.tables,
    )


def write_table(sweep: SweepSpec, player: SpecPlayer, path: Path) -> None:
    """The readable files of a run and its report; plays nothing that the search has not."""
    spec = table_spec(sweep)
    player.play(spec)
    directory, plan = RunDirectory(path), replace(make_plan(spec), illustrations={})
    directory.write_json(SPEC, describe(spec))
    counts = write_readable(plan, player.store, player.ledger, directory)
    directory.write_json(PROVENANCE, provenance() | {"counts": counts})
    build_report(path)
