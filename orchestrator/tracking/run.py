"""MLflow's view of a run directory, as commands keep it up to date."""

from __future__ import annotations

from orchestrator import tracking
from orchestrator.errors import LockedError
from orchestrator.storage.rundir import RunDirectory
from orchestrator.tracking.receipt import read_receipt

NO_TRACKING = "none"


def publish(
    directory: RunDirectory, uri: str, *, finished: bool = False, failed: bool = False
) -> str:
    """Bring MLflow's view of a run up to date; returns what went wrong, "" if nothing did."""
    if uri == NO_TRACKING:
        return ""
    outcome = tracking.publish(directory.path, uri, finished=finished, failed=failed)
    return "" if outcome.ok else f"{outcome.error}; the next command publishes what was missed"


def catch_up(directory: RunDirectory) -> str:
    """Publish what an earlier command could not; cheap where nothing was missed.

    A run under way is left to its own process.
    """
    receipt = read_receipt(directory.path)
    if receipt is None:
        return ""
    try:
        with directory.locked():
            return publish(
                directory,
                receipt.uri,
                finished=directory.played,
                failed=receipt.status == "FAILED" and not directory.played,
            )
    except LockedError:
        return ""
