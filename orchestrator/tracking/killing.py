"""What was interrupted is KILLED in MLflow: at once, and without keeping anybody waiting."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread

from analysis.schema import PROVENANCE, SPEC
from orchestrator.tracking.names import experiment_name
from orchestrator.tracking.receipt import read_json, read_receipt, write_receipt
from orchestrator.tracking.stores import connect, is_gone, turn_to_write
from orchestrator.tracking.views import RUN_ID

SECONDS_TO_KILL = 5.0  # batch systems and containers kill for good soon after SIGTERM


def mark_killed(run_dir: Path, uri: str) -> None:
    """Mark as KILLED what MLflow shows of a run as RUNNING; publishes nothing else.

    What cannot be done in time, the next command does: the receipt tells it.
    """
    receipt = read_receipt(run_dir)
    if receipt is None or (receipt.published and receipt.status != "RUNNING"):
        return  # nothing of this work has been published
    with suppress(Exception):
        write_receipt(run_dir, replace(receipt, published="", status="KILLED"))
    with suppress(Exception):
        benchmark = read_json(run_dir / SPEC, {})["benchmark"]
        run_id = read_json(run_dir / PROVENANCE, {})["run_id"]
        in_time(lambda: kill_runs(uri, benchmark, run_id))


def in_time(work: Callable[[], object]) -> None:
    """Do it, but wait no longer than SECONDS_TO_KILL; nothing that it raises matters."""

    def quietly() -> None:
        with suppress(Exception):
            work()

    thread = Thread(target=quietly, daemon=True)
    thread.start()
    thread.join(SECONDS_TO_KILL)


def kill_runs(uri: str, benchmark: str, run_id: str) -> None:
    """Mark the MLflow runs of one run or sweep that are RUNNING as KILLED."""
    if is_gone(uri):
        return
    with turn_to_write(uri):
        client = connect(uri)
        experiment = client.get_experiment_by_name(experiment_name(benchmark))
        if experiment is None:
            return
        running = f"tags.`{RUN_ID}` = '{run_id}' AND attributes.status = 'RUNNING'"
        for run in client.search_runs([experiment.experiment_id], running, max_results=5000):
            client.set_terminated(run.info.run_id, "KILLED")
