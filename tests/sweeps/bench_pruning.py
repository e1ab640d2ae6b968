"""`python -m tests.sweeps.bench_pruning`: what giving up hopeless trials saves, and costs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.reproduction import LazyExecutor
from orchestrator.storage.rundir import RunDirectory
from orchestrator.work.progress import Silent
from orchestrator.work.worker import use_one_thread
from sweeps.confirm import confirm_spec
from sweeps.player import SpecPlayer
from sweeps.scoring import play_candidates
from sweeps.spec import Confirm, Pruner, SweepSpec, load_sweep
from tests.bench.result import HEADER, Result
from tests.sweeps.tiny import settings, sweep_in

SPEC = Path(__file__).with_name("pruning.toml")
ROUNDS, P = 10, 0.2


def measure() -> Iterator[Result]:
    """The same search with and without the pruner, each in a store that has the models alone."""
    whole = load_sweep(str(SPEC))
    pruned = replace(whole, pruner=Pruner(rounds=ROUNDS, p=P))
    with TemporaryDirectory() as folder:
        first, second = Path(folder, "whole"), Path(folder, "pruned")
        steps = {first: _steps(first, whole)}
        shutil.copytree(
            first / "store", second / "store", ignore=shutil.ignore_patterns("blocks.sqlite*")
        )
        steps[second] = _steps(second, pruned)
        trials = RunDirectory(second / "sweep").read_json("trials.json")
        yield Result(
            "pruning",
            "environment steps of a search with the pruner over without",
            {
                "without": steps[first],
                "with": steps[second],
                "trials": len(trials),
                "given up": sum(trial["pruned"] for trial in trials),
            },
            ratio=steps[second] / steps[first],
            at_most=0.5,
        )
        yield _winners(whole, first, second)


def _steps(root: Path, sweep: SweepSpec) -> float:
    counts = sweep_in(root, sweep).read_json("counts.json")
    return float(sum(counts["environment steps"].values()))


def _winners(sweep: SweepSpec, first: Path, second: Path) -> Result:
    """The pruned search's winner over the other's, on held-out tasks and fresh episodes.

    Seed 0 again, with four times the episodes: what is compared are two settings, not two models.
    """
    winners = [RunDirectory(root / "sweep").read_json("winner.json") for root in (first, second)]
    spec, _ = confirm_spec(replace(sweep, confirm=Confirm(seeds=(1,))))
    spec = replace(spec, seeds=1, episodes=100)
    ledger = RunDirectory(first / "sweep").ledger()
    player = SpecPlayer(first / "store", ledger, LazyExecutor(settings(first)), Silent())
    one, other = play_candidates(player, spec, [winner["fields"] for winner in winners])
    player.close()
    ledger.close()
    gain = other.gain_over(one.episodes, "pruning")
    return Result(
        "pruning",
        "pruned search's winner over the unpruned one's: upper end of 95 %",
        {
            "difference": gain.difference,
            "low": gain.low,
            "high": gain.high,
            "unpruned winner's score": gain.score_second,
            "No-Stitch's": one.result("bench")["no_stitch"],
        },
        ratio=gain.high,
        at_least=0.0,
    )


if __name__ == "__main__":
    use_one_thread()
    print(HEADER)
    for result in measure():
        print(result.lines(), flush=True)
