"""The MLflow view of a sweep: a parent run, and a child for each finished trial."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event

from analysis.schema import SPEC, leaves
from orchestrator.spec.structure import Plain
from orchestrator.storage.claim import spec_of
from orchestrator.storage.rundir import RunDirectory
from orchestrator.tracking.killing import in_time, kill_runs
from orchestrator.tracking.live import Live
from orchestrator.tracking.metrics import finite
from orchestrator.tracking.names import (
    allowed_name,
    experiment_name,
    run_name,
    short_id,
    short_text,
)
from orchestrator.tracking.receipt import Status
from orchestrator.tracking.run import NO_TRACKING
from orchestrator.tracking.stores import connect, open_experiment, turn_to_write
from orchestrator.tracking.views import RunView
from orchestrator.tracking.writing import Publisher, check_time
from orchestrator.work.progress import Progress

HIDDEN = ("fields", "trial", "tasks")  # of a trial's numbers
SECONDS_BETWEEN = 60.0  # of publications while the search goes on


class Tracker:
    """Publishes what the sweep's directory holds; what fails is said and never raised."""

    def __init__(self, uri: str, directory: RunDirectory, run_id: str, progress: Progress) -> None:
        self._uri, self._directory, self._run_id = uri, directory, run_id
        self._progress = progress

    @contextmanager
    def told(self) -> Iterator[None]:
        """MLflow shows the sweep within it as RUNNING, and after it how it ended."""
        if self._uri == NO_TRACKING:
            yield
            return
        try:
            with Live(self._publish_quietly, SECONDS_BETWEEN):
                yield
            self._publish_last("FINISHED")
        except KeyboardInterrupt:
            in_time(lambda: kill_runs(self._uri, self._benchmark, self._run_id))
            raise
        except Exception:
            self._publish_last("FAILED")
            raise

    def _publish_last(self, status: Status) -> None:
        try:
            self.publish(status)
        except Exception as error:
            reason = (str(error).strip() or type(error).__name__).splitlines()[0][:300]
            self._progress.say(f"tracking: {reason}; the next command publishes what was missed")

    def _publish_quietly(self, ending: Event) -> None:
        with suppress(Exception):  # the last publication brings what is missed
            self.publish("RUNNING", ending)

    @property
    def _benchmark(self) -> str:
        return spec_of(self._directory).benchmark

    def publish(self, status: Status, ending: Event | None = None) -> None:
        """Bring MLflow up to date; raises what MLflow does, TrackingError once `ending` is set."""
        directory, ending = self._directory, ending or Event()
        names = (SPEC, "sweep.json", "trials.json", "confirm.json", "winner.json")
        files = {n: directory.path / n for n in names if (directory.path / n).is_file()}
        report = directory.path / "report"
        pages = {
            str(path.relative_to(directory.path)): path
            for path in sorted(report.rglob("*"))
            if path.is_file()
        }
        sweep = directory.read_json("sweep.json")
        parent = RunView(
            name=run_name(f"sweep {sweep['name']}", sweep["scale"], short_id(self._run_id)),
            status=status,
            identity=(self._run_id, "", ""),
            tags={"mlflow.source.name": "skillstitch", "skillstitch.sweep": sweep["name"]},
            params={allowed_name(k): short_text(v) for k, v in leaves(sweep, ".").items()},
            numbers=finite(_winner_numbers(directory)),
            curves={},
            files=files | pages,
        )
        children = [self._child(parent, t) for t in directory.read_json("trials.json") or []]
        with turn_to_write(self._uri):
            client = connect(self._uri)
            check_time(ending)
            experiment = open_experiment(client, self._uri, experiment_name(self._benchmark))
            files |= pages
            Publisher(client, experiment, files, self._run_id, ending).write(parent, children)

    def _child(self, parent: RunView, trial: Plain) -> RunView:
        number = str(trial["trial"])
        return RunView(
            name=run_name(f"trial {number}", short_id(self._run_id)),
            status="FINISHED",
            identity=(self._run_id, "trial", number),
            tags=parent.tags | {"skillstitch.trial": number},
            params={allowed_name(k): short_text(v) for k, v in trial["fields"].items()}
            | {"method": short_text(trial["method"])},
            numbers=finite(leaves({k: v for k, v in trial.items() if k not in HIDDEN}, "/")),
            curves={},
        )


def _winner_numbers(directory: RunDirectory) -> Plain:
    winner = directory.read_json("winner.json") or {}
    parts = {name: winner.get(name, {}) for name in ("search", "confirmed")}
    shown = {n: {k: v for k, v in p.items() if k not in HIDDEN} for n, p in parts.items()}
    return leaves({"winner": shown}, "/")
