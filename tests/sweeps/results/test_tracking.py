"""The MLflow view of a sweep."""

from pathlib import Path
from threading import Event

import pytest

from orchestrator.storage.rundir import RunDirectory
from orchestrator.tracking import default_uri
from orchestrator.tracking.stores import TrackingError
from orchestrator.work.progress import Silent
from sweeps.results.tracking import Tracker


def test_a_publication_begins_nothing_once_the_work_has_ended(done: Path) -> None:
    pytest.importorskip("mlflow")
    from mlflow import MlflowClient

    uri, ending = default_uri(done), Event()
    ending.set()
    with pytest.raises(TrackingError, match="the work ended"):
        Tracker(uri, RunDirectory(done / "sweep"), "abc123", Silent()).publish("RUNNING", ending)
    client = MlflowClient(tracking_uri=uri)
    assert client.get_experiment_by_name("skillstitch/maze") is None
