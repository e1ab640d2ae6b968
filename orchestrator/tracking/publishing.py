"""Publishing a run directory: never in the way of the science, and cheap where nothing is new."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from analysis.schema import PROVENANCE
from orchestrator.tracking.receipt import (
    Receipt,
    Status,
    news,
    published_files,
    read_receipt,
    write_receipt,
)
from orchestrator.tracking.stores import (
    connect,
    is_gone,
    open_experiment,
    turn_to_write,
    without_password,
)
from orchestrator.tracking.views import read_views
from orchestrator.tracking.writing import Publisher


@dataclass(frozen=True)
class PublishOutcome:
    """How a publish went. It never raises: tracking that fails must not stop the science."""

    ok: bool
    error: str = ""  # one line
    skipped: bool = False  # everything was there already


def publish(run_dir: Path, uri: str, *, finished: bool, failed: bool = False) -> PublishOutcome:
    """Make MLflow show what the run directory holds; cheap if it already does.

    The parent run is RUNNING until `finished` or `failed`; children always end terminated.
    """
    status: Status = "FAILED" if failed else "FINISHED" if finished else "RUNNING"
    try:
        return _publish(run_dir, uri, status)
    except Exception as error:
        return PublishOutcome(ok=False, error=_one_line(error, uri))


def _publish(run_dir: Path, uri: str, status: Status) -> PublishOutcome:
    if not (run_dir / PROVENANCE).is_file():  # the work has not begun: nothing to show
        return PublishOutcome(ok=True, skipped=True)
    wanted = Receipt(without_password(uri), news(run_dir), status)
    # Results that were complete stay so, whatever became of a later command that added nothing.
    settled = (wanted, replace(wanted, status="FINISHED"))
    if read_receipt(run_dir) in settled and not is_gone(uri):
        return PublishOutcome(ok=True, skipped=True)
    write_receipt(run_dir, replace(wanted, published=""))
    parent, *children = read_views(run_dir, status)
    with turn_to_write(uri):
        client = connect(uri)
        experiment = open_experiment(
            client, uri, f"skillstitch/{parent.tags['skillstitch.benchmark']}"
        )
        files = published_files(run_dir)
        Publisher(client, experiment, files, parent.identity[0]).write(parent, children)
    write_receipt(run_dir, wanted)
    return PublishOutcome(ok=True)


def _one_line(error: Exception, uri: str) -> str:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    return without_password(f"MLflow at {uri} was not updated: {reason[:300]}")
