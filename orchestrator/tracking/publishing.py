"""Publishing a run directory: never in the way of the science, and cheap where nothing is new."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event

from analysis.schema import PROVENANCE
from orchestrator.tracking.live import Growing
from orchestrator.tracking.names import experiment_name
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
from orchestrator.tracking.writing import Publisher, check_time


@dataclass(frozen=True)
class PublishOutcome:
    """How a publish went. It never raises: tracking that fails must not stop the science."""

    ok: bool
    error: str = ""  # one line
    skipped: bool = False  # everything was there already


def publish(
    run_dir: Path,
    uri: str,
    status: Status,
    ending: Event | None = None,
    growing: Growing | None = None,
) -> PublishOutcome:
    """Make MLflow show what the run directory holds; cheap if it already does.

    The parent run gets the status, and so do children without a score; others are FINISHED.
    ending: once it is set, the publication breaks off. growing: learning curves, before they are in
    the directory.
    """
    try:
        return _publish(run_dir, uri, status, ending or Event(), growing)
    except Exception as error:
        return PublishOutcome(ok=False, error=_one_line(error, uri))


def _publish(
    run_dir: Path, uri: str, status: Status, ending: Event, growing: Growing | None
) -> PublishOutcome:
    if not (run_dir / PROVENANCE).is_file():  # the work has not begun: nothing to show
        return PublishOutcome(ok=True, skipped=True)
    wanted = Receipt(without_password(uri), news(run_dir), status)
    # Results that were complete stay so, whatever became of a later command that added nothing.
    settled = (wanted, replace(wanted, status="FINISHED"))
    training = growing.read() if growing else None
    nothing_grew = growing is None or training == growing.published
    if nothing_grew and read_receipt(run_dir) in settled and not is_gone(uri):
        return PublishOutcome(ok=True, skipped=True)
    check_time(ending)
    write_receipt(run_dir, replace(wanted, published=""))
    parent, *children = read_views(run_dir, status, training)
    with turn_to_write(uri):
        client = connect(uri)
        check_time(ending)
        experiment = open_experiment(
            client, uri, experiment_name(parent.tags["skillstitch.benchmark"])
        )
        files = published_files(run_dir)
        points = growing.points if growing else None
        publisher = Publisher(client, experiment, files, parent.identity[0], ending, points)
        publisher.write(parent, children)
        check_time(ending)
    write_receipt(run_dir, wanted)
    if growing:
        growing.published = training
    return PublishOutcome(ok=True)


def _one_line(error: Exception, uri: str) -> str:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    return without_password(f"MLflow at {uri} was not updated: {reason[:300]}")
