"""Brings MLflow's runs to what the views say they should be, whatever is there already."""

from __future__ import annotations

import json
import math
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from analysis.schema import SPEC
from orchestrator.tracking.stores import TrackingError
from orchestrator.tracking.views import IDENTITY, METHOD, RUN_ID, RunView

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Run

CONTENT = "skillstitch.content"  # tag set after all else: it vouches that nothing is missing
PUBLISH_SECONDS = 90.0  # after this a slow server gets the rest at the next publish
BATCH = 100  # params or tags a call; metrics may be ten times as many
METRIC_BATCH = 1000


class Publisher:
    """Brings the MLflow runs of one run directory to what they should be."""

    def __init__(
        self,
        client: MlflowClient,
        experiment: str,
        files: Mapping[str, Path],
        run_id: str,
        ending: Event | None = None,  # once it is set, `write` breaks off
        points: dict[tuple[str, str], int] | None = None,  # MLflow run, metric → that are there
    ) -> None:
        self._client = client
        self._experiment = experiment
        self._ending = ending or Event()
        self._points = {} if points is None else points
        self._deadline = time.monotonic() + PUBLISH_SECONDS
        self._began = int(files[SPEC].stat().st_mtime * 1000)
        self._ended = int(max(path.stat().st_mtime for path in files.values()) * 1000)
        self._found: dict[tuple[str, ...], list[Run]] = defaultdict(list)
        query = f"tags.`{RUN_ID}` = '{run_id}'"
        for run in client.search_runs([experiment], query, max_results=5000):
            self._found[tuple(run.data.tags.get(tag, "") for tag in IDENTITY)].append(run)

    def write(self, parent: RunView, children: Sequence[RunView]) -> None:
        """The parent's status comes last: until then a kill leaves it RUNNING, to be resumed.

        What no view is of any more is retired once the work is done. Before, a child's learning
        curves may not be in the directory yet, so it stays and gets the parent's status.
        """
        self._check_time()
        above = self._take(parent, {})
        self._fill(above, parent)
        for child in children:
            self._check_time()
            run = self._take(child, {"mlflow.parentRunId": above.info.run_id})
            self._fill(run, child)
            self._settle(run, child.status)
        for left in [run for runs in self._found.values() for run in runs]:
            if parent.status == "FINISHED" or METHOD not in left.data.tags:
                self._retire(left)
            else:
                self._settle(left, parent.status)
        check_time(self._ending)
        self._settle(above, parent.status)

    def _take(self, view: RunView, tags: dict[str, str]) -> Run:
        """The run that shows this view, new if need be; doubles of it are retired."""
        runs = self._found.pop(view.identity, [])
        # MLflow cannot change a param: where one differs, a new run takes the old one's place.
        fitting = [run for run in runs if _agree(run.data.params, view.params)]
        kept = min(fitting, key=lambda run: run.info.run_id, default=None)
        for double in runs:
            if double is not kept:
                self._retire(double)
        if kept is not None:
            return kept
        identity = {tag: value for tag, value in zip(IDENTITY, view.identity, strict=True) if value}
        return self._client.create_run(
            self._experiment, start_time=self._began, tags=identity | tags, run_name=view.name
        )

    def _fill(self, run: Run, view: RunView) -> None:
        content = view.content
        if run.data.tags.get(CONTENT) == content:
            return
        from mlflow.entities import Param, RunTag

        run_id = run.info.run_id
        for metrics in _batches(_metrics(run, view, self._points), METRIC_BATCH):
            self._check_time()
            self._client.log_batch(run_id, metrics=metrics)
        self._points |= {(run_id, key): len(curve) for key, curve in view.curves.items()}
        new_params = view.params.items() - run.data.params.items()
        new_tags = view.tags.items() - run.data.tags.items()
        for params in _batches([Param(*item) for item in sorted(new_params)], BATCH):
            self._check_time()
            self._client.log_batch(run_id, params=params)
        if view.datasets:
            self._check_time()
            self._client.log_inputs(run_id, datasets=[_dataset(entry) for entry in view.datasets])
        for name, path in view.files.items():
            self._check_time()
            folder = Path(name).parent.as_posix()
            self._client.log_artifact(run_id, str(path), None if folder == "." else folder)
        for tags in _batches([RunTag(*item) for item in sorted(new_tags)], BATCH):
            self._check_time()
            self._client.log_batch(run_id, tags=tags)
        self._check_time()
        self._client.set_tag(run_id, CONTENT, content)

    def _settle(self, run: Run, status: str) -> None:
        if run.info.status == status:
            return
        if status == "RUNNING":
            self._client.update_run(run.info.run_id, status=status)
        else:
            self._client.set_terminated(run.info.run_id, status, self._ended)

    def _retire(self, run: Run) -> None:
        self._client.set_terminated(run.info.run_id, "KILLED", self._ended)
        self._client.delete_run(run.info.run_id)  # to MLflow's bin, from which it can be restored

    def _check_time(self) -> None:
        check_time(self._ending, self._deadline)


def check_time(ending: Event, deadline: float = math.inf) -> None:
    """Raises TrackingError when a publication is to break off."""
    if ending.is_set():
        raise TrackingError("the work ended meanwhile")
    if time.monotonic() > deadline:
        raise TrackingError(f"it took more than {PUBLISH_SECONDS:.0f} s")


def _metrics(run: Run, view: RunView, points: Mapping[tuple[str, str], int]) -> list[Any]:
    """Numbers that changed, and curves in the order of their steps, without points that are there.

    MLflow drops a row that it has already, timestamp included: curves carry the run's start time.
    A number that changed needs a later time to replace the old one.
    """
    from mlflow.entities import Metric

    now = int(time.time() * 1000)
    known = run.data.metrics
    changed = [Metric(k, v, now, 0) for k, v in view.numbers.items() if known.get(k) != v]
    grown = [
        Metric(key, value, run.info.start_time, step)
        for key, curve in view.curves.items()
        for step, value in curve[points.get((run.info.run_id, key), 0) :]
    ]
    return changed + sorted(grown, key=lambda point: point.step)


def _dataset(entry: Mapping[str, Any]) -> Any:
    from mlflow.entities import Dataset, DatasetInput, InputTag

    dataset = Dataset(
        name=entry["name"],
        digest=entry["digest"][:36],  # MLflow's limit
        source_type="skillstitch",
        source=json.dumps({"artifact": entry["key"], "digest": entry["digest"]}),
        profile=json.dumps({name: entry[name] for name in ("rows", "episodes")}),
    )
    return DatasetInput(dataset, [InputTag("mlflow.data.context", "training")])


def _agree(old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    return all(old.get(name, value) == value for name, value in new.items())


def _batches(items: Sequence[Any], size: int) -> Iterable[Sequence[Any]]:
    return (items[start : start + size] for start in range(0, len(items), size))
