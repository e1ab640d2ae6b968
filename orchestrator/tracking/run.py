"""MLflow's view of a run directory, as commands keep it up to date."""

from __future__ import annotations

from threading import Event

from orchestrator import tracking
from orchestrator.errors import LockedError
from orchestrator.storage.rundir import RunDirectory
from orchestrator.tracking.live import Growing
from orchestrator.tracking.receipt import Status, read_receipt

NO_TRACKING = "none"


def publish(
    directory: RunDirectory,
    uri: str,
    status: Status,
    ending: Event | None = None,
    growing: Growing | None = None,
) -> str:
    """Bring MLflow's view of a run up to date; returns what went wrong, "" if nothing did."""
    if uri == NO_TRACKING:
        return ""
    outcome = tracking.publish(directory.path, uri, status, ending, growing)
    return "" if outcome.ok else f"{outcome.error}; the next command publishes what was missed"


def mark_killed(directory: RunDirectory, uri: str) -> None:
    """Say in MLflow that the work was interrupted."""
    if uri != NO_TRACKING:
        tracking.mark_killed(directory.path, uri)


def catch_up(directory: RunDirectory) -> str:
    """Publish what an earlier command could not; cheap where nothing was missed.

    A run under way is left to its own process; one whose process was killed is KILLED.
    """
    receipt = read_receipt(directory.path)
    if receipt is None:
        return ""
    try:
        with directory.locked():
            ended: Status = "FAILED" if receipt.status == "FAILED" else "KILLED"
            return publish(directory, receipt.uri, "FINISHED" if directory.written else ended)
    except LockedError:
        return ""
