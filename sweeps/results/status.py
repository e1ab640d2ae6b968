"""`skillstitch status` and `list` of a sweep: how far it is, from what lies in its directory.

Read as plain files: Optuna, and all that plays, take seconds to import.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from orchestrator.spec.structure import Plain
from orchestrator.status import block_counts, failure_lines
from orchestrator.storage.rundir import PLANNED, RunDirectory
from orchestrator.storage.store import Store
from sweeps.journal import JOURNAL, entries
from sweeps.results.again import SOURCE, command_here

CREATED, ASKED, TOLD = 0, 4, 6  # operations of Optuna's journal: a study, a trial, its end
MINIMISED = 1  # a direction, in Optuna's numbers


@dataclass(frozen=True)
class SearchState:
    """How far a search is."""

    asked: Plain  # sweep.json
    trials: list[Plain]  # trials.json: those that are finished
    open: int  # trials that were asked and are not finished
    maximised: bool  # whether more of the first objective is better
    written: bool  # whether it was confirmed and written up

    @property
    def all_played(self) -> bool:
        return len(self.trials) >= self.asked["trials"]

    @property
    def given_up(self) -> int:
        return sum(trial["pruned"] for trial in self.trials)

    @property
    def best(self) -> Plain | None:
        """As `sweeps.study.SweepStudy.ranked` has it; None where no trial can be."""
        kept = [trial for trial in self.trials if trial["feasible"] and not trial["pruned"]]
        sign, name = -1 if self.maximised else 1, self.asked["objectives"][0]
        return min(kept, key=lambda trial: (sign * trial[name], trial["trial"]), default=None)


def state_of(directory: RunDirectory) -> SearchState:
    """Raises StorageError for a damaged file; the directory must be of a sweep."""
    asked = directory.asked_sweep()
    assert asked is not None
    count: Counter[int] = Counter()
    direction = 0
    for entry in entries(directory.path / JOURNAL):
        count[entry["op_code"]] += 1
        if entry["op_code"] == CREATED:
            direction = entry["directions"][0]
    return SearchState(
        asked,
        directory.read_json("trials.json") or [],
        count[ASKED] - count[TOLD],
        direction != MINIMISED,
        _written(directory),
    )


def _written(directory: RunDirectory) -> bool:
    if (directory.path / SOURCE).is_file():
        return directory.written
    # An earlier version's, which left no mark; it chose the winner after confirmation.
    return (directory.path / "winner.json").is_file()


def state(directory: RunDirectory) -> str:
    """In a few words, for a list of runs."""
    search = state_of(directory)
    trials = f"{len(search.trials)} of {search.asked['trials']} trials"
    return f"finished, {trials}" if search.written else f"unfinished, {trials}"


def sweep_lines(directory: RunDirectory, store_root: Path | None = None) -> Iterator[str]:
    """How far a sweep is, what it has found, and what to do next.

    Artifacts are looked for in a store, by default its own. Raises StorageError for a damaged file.
    """
    search = state_of(directory)
    asked = search.asked
    yield f"{directory.path}: sweep {asked['name']} at {asked['scale']} scale"
    yield f"  artifacts  {_artifacts(directory, Store(store_root or directory.store_root))}"
    yield from _block_lines(directory)
    trials = f"{len(search.trials)} of {asked['trials']} finished"
    trials += f", {search.given_up} of them given up early" if search.given_up else ""
    trials += f"; {search.open} more asked and not finished" if search.open else ""
    yield f"  trials     {trials}"
    if search.best is not None:
        best = search.best
        yield f"  best       trial {best['trial']}: {_number(search, best)}, {best['setting']}"
    yield f"  confirmed  {_confirmed(directory, search)}"
    written = [directory.path / "report" / f"index.{kind}" for kind in ("html", "md")]
    report = next((str(path) for path in written if path.is_file()), "not written yet")
    yield f"  report     {report}"
    yield f"  next       {_next(directory, search)}"


def _artifacts(directory: RunDirectory, store: Store) -> str:
    """Those that all trials share; where each has its own, those that were trained."""
    if shared := (directory.read_json(PLANNED) or {}).get("artifacts"):
        built = sum((kind, key) in store for kind, key in shared)
        return f"{built} of {len(shared)} that all trials share"
    trained = (directory.read_json("counts.json") or {}).get("artifacts trained", {})
    kinds = ", ".join(f"{kind} {count}" for kind, count in trained.items())
    return f"{sum(trained.values())} trained" + (f" ({kinds})" if kinds else "")


def _block_lines(directory: RunDirectory) -> Iterator[str]:
    if not (directory.path / "ledger.sqlite").is_file():
        yield "  blocks     0 played"
        return
    played, failed = block_counts(directory)
    yield f"  blocks     {played:,} played"
    yield from failure_lines(failed)


def _number(search: SearchState, result: Plain) -> str:
    """ "gain +0.213 [+0.150, +0.270]": the first objective, with its interval if it has one."""
    name = search.asked["objectives"][0]
    if f"{name}_low" not in result:
        return f"{name} {result[name]:,.4g}"
    low, high = result[f"{name}_low"], result[f"{name}_high"]
    return f"{name} {result[name]:+.3f} [{low:+.3f}, {high:+.3f}]"


def _confirmed(directory: RunDirectory, search: SearchState) -> str:
    wanted = search.asked["confirm"]["best"]
    if not wanted:
        return "not asked for; `confirm` in its file would tell how much of the best survives"
    found = directory.read_json("confirm.json") or {}
    rows = {row["trial"]: row for row in found.get("trials", [])}
    if search.best is None or search.best["trial"] not in rows:
        return f"not yet; the best {wanted} are played again when all trials are finished"
    where = "held-out tasks" if found["held_out"] else "the search's tasks"
    again = rows[search.best["trial"]]
    return f"{_number(search, again)} on {len(found['tasks'])} {where}, by new seeds"


def _next(directory: RunDirectory, search: SearchState) -> str:
    if search.all_played and search.best is None:
        return "no trial keeps to the constraints: loosen them, under another --out"
    if not search.written:
        again = command_here(directory, search.asked)
        return f"unless it is at work, the same command goes on: {again}"
    words = ["skillstitch", "run", search.asked["base"], "--from-sweep", str(directory.path)]
    return f"with the winner: {shlex.join(words)}"
