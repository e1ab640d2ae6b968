"""The MLflow view of a run directory: the directory is the truth, the view can always be rebuilt.

One parent run a reproduction and one child run a (method, seed), found again by their tags, so
that publishing is idempotent: whatever a kill left half done, the next publish completes.
MLflow is imported inside functions, because that takes seconds and most commands need none of it.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import logging
import math
import os
import re
import sqlite3
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from orchestrator.store import write_atomically

if TYPE_CHECKING:
    import pandas as pd
    from mlflow import MlflowClient
    from mlflow.entities import Run

    from analysis.run import RunSpec, TableEntry

Status = Literal["RUNNING", "FINISHED", "FAILED"]
Curves = dict[str, list[tuple[int, float]]]

RUN_ID, METHOD, SEED = IDENTITY = ("skillstitch.run_id", "skillstitch.method", "skillstitch.seed")
NOTE = "mlflow.note.content"  # the description that MLflow shows at the top of a run
CONTENT = "skillstitch.content"  # tag set after all else: it vouches that nothing is missing

SETTINGS = {
    "DO_NOT_TRACK": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "5",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
TURN_SECONDS = 30.0  # wait for another skillstitch that writes to the same SQLite store
LOCK_SECONDS = 10.0  # wait for any other program that has locked it
PUBLISH_SECONDS = 90.0  # after this a slow server gets the rest at the next publish

DATED = ("provenance.json", "report/index.html")
"""Files that tell when they were written, and so cannot tell whether there is anything new."""

LONGEST_TEXT = 500  # of a param or tag: what every MLflow version takes
LONGEST_KEY = 250
BATCH = 100  # params or tags a call; metrics may be ten times as many
METRIC_BATCH = 1000

EXTRA_ARTIFACT = {"mb-stitch": "dynamics", "mf-stitch": "mf-policy"}
"""What a method uses beside the agent that all methods share."""


class TrackingError(Exception):
    """Tracking cannot be used now; the message says why."""


@dataclass(frozen=True)
class PublishOutcome:
    """How a publish went. It never raises: tracking that fails must not stop the science."""

    ok: bool
    error: str = ""  # one line
    skipped: bool = False  # everything was there already


@dataclass(frozen=True)
class Receipt:
    """`tracking.json`: what the last publish left in MLflow. Delete it to publish anew."""

    uri: str
    published: str  # digest of the files; "" from the start of a publish until its success
    status: Status


@dataclass(frozen=True)
class RunView:
    """One MLflow run as it should be."""

    name: str
    status: Status
    identity: tuple[str, str, str]  # values of IDENTITY; no method and seed for the parent
    tags: dict[str, str]
    params: dict[str, str]
    numbers: dict[str, float]  # metrics without a history: scores, intervals, timings
    curves: Curves
    datasets: list[dict[str, Any]] = field(default_factory=list)
    files: dict[str, Path] = field(default_factory=dict)  # artifacts

    @property
    def content(self) -> str:
        """Digest of all that is logged; the status is kept apart."""
        plain = asdict(replace(self, status="RUNNING", files={}))
        return hashlib.sha256(f"{json.dumps(plain)}{digest(self.files)}".encode()).hexdigest()


def default_uri(root: Path) -> str:
    """A SQLite store under `root`; its artifacts go to the folder `mlartifacts` beside it."""
    return f"sqlite:///{root.resolve() / 'mlflow.db'}"


def pending(run_dir: Path, uri: str) -> bool:
    """Whether the last publish failed, was killed or saw other files. Imports no MLflow."""
    receipt = _read_receipt(run_dir)
    return (
        receipt is None
        or receipt.uri != without_password(uri)
        or receipt.published != _news(run_dir)
        or _store_is_gone(uri)
    )


def prepare(uri: str) -> PublishOutcome:
    """Import MLflow and create the store's schema ahead of time, in a background thread if wanted.

    Threads and processes that publish meanwhile wait for their turn.
    """
    try:
        with _turn_to_write(uri):
            _client(uri)
    except Exception as error:
        return PublishOutcome(ok=False, error=_one_line(error, uri))
    return PublishOutcome(ok=True)


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
    wanted = Receipt(without_password(uri), _news(run_dir), status)
    # Results that were complete stay so, whatever became of a later command that added nothing.
    settled = (wanted, replace(wanted, status="FINISHED"))
    if _read_receipt(run_dir) in settled and not _store_is_gone(uri):
        return PublishOutcome(ok=True, skipped=True)
    _write_receipt(run_dir, replace(wanted, published=""))
    parent, *children = read_views(run_dir, status)
    with _turn_to_write(uri):
        client = _client(uri)
        experiment = _experiment(client, uri, f"skillstitch/{parent.tags['skillstitch.benchmark']}")
        files = _published_files(run_dir)
        _Publisher(client, experiment, files, parent.identity[0]).write(parent, children)
    _write_receipt(run_dir, wanted)
    return PublishOutcome(ok=True)


# --- The run directory, as MLflow runs ---------------------------------------------------------


def read_views(run_dir: Path, status: Status) -> list[RunView]:
    """The parent's view, then one for each (method, seed) that there is something to show of."""
    from analysis.run import RunSpec

    plain = json.loads((run_dir / "spec.json").read_text())
    provenance = _read_json(run_dir / "provenance.json", {})
    training = _read_json(run_dir / "training.json", [])
    spec = RunSpec.from_dict(plain)
    parent = RunView(
        name=f"{spec.name} {spec.scale}",
        status=status,
        identity=(provenance["run_id"], "", ""),
        tags=_tags(spec, provenance) | {NOTE: spec.title, "skillstitch.run_dir": str(run_dir)},
        params={_key(name): _text(value) for name, value in _leaves(plain["spec"], ".").items()},
        numbers=_finite(
            *(_leaves({part: provenance.get(part, {})}, "/") for part in ("timings", "counts")),
            *(_reported(run_dir / "report", entry.id) for entry in spec.tables),
        ),
        curves={},
        datasets=_read_json(run_dir / "datasets.json", []),
        files={
            name: path
            for name, path in _published_files(run_dir).items()
            if name in ("spec.json", "provenance.json") or name.startswith("report/")
        },
    )
    episodes = _read_episodes(run_dir)
    played = dict(list(episodes.groupby(["method", "seed"])))
    children = [
        _child(parent, spec, method, seed, training, played.get((method, seed), episodes.iloc[:0]))
        for method in spec.methods
        for seed in spec.seeds
    ]
    return [parent, *(child for child in children if child.numbers or child.curves)]


def _child(
    parent: RunView,
    spec: RunSpec,
    method: str,
    seed: int,
    training: list[dict[str, Any]],
    episodes: pd.DataFrame,
) -> RunView:
    """One method under one seed, its metrics named as all others' so that they can be compared."""
    alone = replace(spec, methods={method: spec.methods[method]}, seeds=(seed,))
    numbers = _finite(*(_seed_scores(episodes, alone, entry) for entry in spec.tables))
    return RunView(
        name=f"{method} seed {seed}",
        status="FAILED" if parent.status == "FAILED" and not numbers else "FINISHED",
        identity=(parent.identity[0], method, str(seed)),
        tags={name: value for name, value in parent.tags.items() if name != NOTE},
        params=parent.params | _overrides(method) | {"method": method, "seed": str(seed)},
        numbers=numbers,
        curves=_curves(method, seed, training),
    )


def _tags(spec: RunSpec, provenance: Mapping[str, Any]) -> dict[str, str]:
    tags = {
        "mlflow.source.name": "skillstitch",
        "mlflow.source.git.commit": provenance.get("git_revision"),
        "skillstitch.spec": spec.name,
        "skillstitch.benchmark": spec.benchmark,
        "skillstitch.scale": spec.scale,
        "skillstitch.cpu": provenance.get("cpu"),
        **_leaves({"version": provenance.get("versions", {})}, "."),
    }
    return {name: _text(value) for name, value in tags.items() if value}


def _overrides(method: str) -> dict[str, str]:
    """ "mb-stitch[alpha=1]" was played with another `mb_stitch.alpha` than the spec's."""
    name = method.partition("[")[0].replace("-", "_")
    return {f"{name}.{key}": value for key, value in re.findall(r"([\w.]+)=([^,\]]+)", method)}


def _reported(report: Path, table: str) -> dict[str, float]:
    """Scores and gains as the report gives them; nothing before there is a report."""
    import pandas as pd

    scores, gains = report / f"{table}.csv", report / f"{table}-gains.csv"
    if not (scores.is_file() and gains.is_file()):
        return {}
    reported = {
        f"{table}/{cell['row']}/{cell['method']}/{column}": cell[column]
        for cell in pd.read_csv(scores).to_dict("records")
        for column in ("score", "ci_low", "ci_high", "episodes")
    }
    return reported | {
        f"{table}/{duel['row']}/{duel['method']} over {duel['baseline']}/{column}": duel[column]
        for duel in pd.read_csv(gains).to_dict("records")
        for column in ("gain", "ci_low", "ci_high")
    }


def _seed_scores(episodes: pd.DataFrame, spec: RunSpec, entry: TableEntry) -> dict[str, float]:
    """Scores of one seed by the table's rows, every task weighing the same.

    The interval takes tasks as given and a score for a rate: as no score in [0, 1] varies more
    than successes and failures of the same mean do, it errs on the wide side.
    """
    from analysis.rows import place_tasks
    from analysis.statistics import wilson

    places = place_tasks(spec, entry)[["task", "row"]]
    tasks = episodes.merge(places, on="task").groupby(["row", "task"])["score"]
    rows = tasks.agg(["mean", "size"]).groupby("row").agg({"mean": "mean", "size": "sum"})
    low, high = wilson(rows["mean"].to_numpy() * rows["size"].to_numpy(), rows["size"].to_numpy())
    cells = rows.rename(columns={"mean": "score", "size": "episodes"}).assign(
        ci_low=low, ci_high=high
    )
    return {
        f"{entry.id}/{row}/{column}": value
        for row, cell in cells.to_dict("index").items()
        for column, value in cell.items()
    }


def _curves(method: str, seed: int, training: list[dict[str, Any]]) -> Curves:
    """Learning curves of the artifacts that this method uses under this seed."""
    kinds = {"agent", *(kind for name, kind in EXTRA_ARTIFACT.items() if method.startswith(name))}
    used = [entry for entry in training if entry["seed"] == seed and entry["kind"] in kinds]
    several = {e["kind"] for e in used if sum(e["kind"] == other["kind"] for other in used) > 1}
    curves: Curves = {}
    for entry in used:
        kind = entry["kind"]
        head = f"{kind} {entry['key'][:8]}" if kind in several else kind
        for name, points in entry["curves"].items():
            finite = [(step, value) for step, value in points if math.isfinite(value)]
            curves[_key(f"{head}/{name}")] = finite
    return curves


def _finite(*parts: Mapping[str, Any]) -> dict[str, float]:
    """Metrics under names that MLflow takes; cells without an episode (NaN) have none."""
    return {
        _key(name): float(value)
        for part in parts
        for name, value in part.items()
        if not isinstance(value, str | list | None) and math.isfinite(value)
    }


def _leaves(plain: Mapping[str, Any], separator: str) -> dict[str, Any]:
    """Nested dicts as one, their keys joined."""
    leaves: dict[str, Any] = {}
    for name, value in plain.items():
        if isinstance(value, dict):
            below = _leaves(value, separator).items()
            leaves |= {f"{name}{separator}{key}": leaf for key, leaf in below}
        else:
            leaves[name] = value
    return leaves


def _key(text: str) -> str:
    """MLflow takes letters, digits and "_-. :/" in names: "mic → lig" becomes "mic to lig"."""
    words = re.sub(r"[^\w\-. :/]", " ", text.replace("→", "to")).split()
    return " ".join(words).replace(" /", "/")[:LONGEST_KEY]


def _text(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 1]}…"


def _read_episodes(run_dir: Path) -> pd.DataFrame:
    import pandas as pd

    from analysis.episodes import COLUMNS

    path = run_dir / "episodes.parquet"
    return pd.read_parquet(path) if path.is_file() else pd.DataFrame(columns=COLUMNS)


def _read_json(path: Path, default: Any) -> Any:
    return json.loads(path.read_text()) if path.is_file() else default


# --- What was published ------------------------------------------------------------------------


def _published_files(run_dir: Path) -> dict[str, Path]:
    """All files that the view is made from, by their path inside the run directory."""
    names = ("spec.json", "provenance.json", "training.json", "datasets.json", "episodes.parquet")
    paths = [run_dir / name for name in names] + sorted((run_dir / "report").rglob("*"))
    return {str(path.relative_to(run_dir)): path for path in paths if path.is_file()}


def _news(run_dir: Path) -> str:
    """What a publish depends on, as a digest."""
    files = _published_files(run_dir)
    return digest({name: path for name, path in files.items() if name not in DATED})


def digest(files: Mapping[str, Path]) -> str:
    """Hash of names and contents."""
    total = hashlib.sha256()
    for name, path in files.items():
        total.update(f"{name}:{hashlib.sha256(path.read_bytes()).hexdigest()};".encode())
    return total.hexdigest()


def _read_receipt(run_dir: Path) -> Receipt | None:
    try:
        return Receipt(**json.loads((run_dir / "tracking.json").read_text()))
    except (OSError, ValueError, TypeError):
        return None  # an unreadable receipt only costs a publish


def _write_receipt(run_dir: Path, receipt: Receipt) -> None:
    write_atomically(run_dir / "tracking.json", json.dumps(asdict(receipt), indent=1).encode())


def without_password(text: str) -> str:
    return re.sub(r"//[^/@\s]*@", "//", text)


def _one_line(error: Exception, uri: str) -> str:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    return without_password(
        f"MLflow at {uri} was not updated: {reason[:300]}. "
        "The run is unaffected; the next command publishes what was missed."
    )


# --- Stores ------------------------------------------------------------------------------------


def _database(uri: str) -> Path | None:
    """The file of a SQLite store, None for any other."""
    return Path(uri.removeprefix("sqlite:///")) if uri.startswith("sqlite:///") else None


def _store_is_gone(uri: str) -> bool:
    database = _database(uri)
    return database is not None and not database.exists()


@contextmanager
def _turn_to_write(uri: str) -> Iterator[None]:
    """One publisher at a time for a SQLite store; servers see to that themselves.

    Raises TrackingError if the store stays locked. Asked up front, because MLflow itself would
    wait 20 seconds in every single call.
    """
    database = _database(uri)
    if database is None:
        yield
        return
    database.parent.mkdir(parents=True, exist_ok=True)
    with database.with_name(f"{database.name}.lock").open("w") as file:
        deadline = time.monotonic() + TURN_SECONDS
        while not _try_lock(file.fileno()):
            if time.monotonic() > deadline:
                raise TrackingError(f"another skillstitch kept it busy for {TURN_SECONDS:.0f} s")
            time.sleep(0.05)
        if database.exists():
            _check_unlocked(database)
        yield


def _try_lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _check_unlocked(database: Path) -> None:
    with closing(sqlite3.connect(database, timeout=LOCK_SECONDS)) as connection:
        try:
            connection.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as error:
            raise TrackingError(f"{error} (waited {LOCK_SECONDS:.0f} s)") from error


def _client(uri: str) -> MlflowClient:
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    from mlflow import MlflowClient

    # What they would say is in the outcome, in one line instead of a traceback.
    for logger in ("mlflow", "alembic", "urllib3"):
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    database = _database(uri)
    if database is not None and not database.exists():
        # A migration killed half-way cannot be resumed: the schema appears whole or not at all.
        draft = database.with_name(f"{database.name}.new")
        draft.unlink(missing_ok=True)
        MlflowClient(tracking_uri=f"sqlite:///{draft}").search_experiments(max_results=1)
        draft.rename(database)
    return MlflowClient(tracking_uri=uri)


def _experiment(client: MlflowClient, uri: str, name: str) -> str:
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is None:
        database = _database(uri)
        folder = None if database is None else (database.parent.resolve() / "mlartifacts").as_uri()
        try:
            return client.create_experiment(name, artifact_location=folder)
        except MlflowException:  # another publisher to the same server was quicker
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage != "active":
        raise TrackingError(f"experiment {name} was deleted there: restore it or use another store")
    return found.experiment_id


# --- Writing -----------------------------------------------------------------------------------


class _Publisher:
    """Brings the MLflow runs of one run directory to what they should be."""

    def __init__(
        self, client: MlflowClient, experiment: str, files: Mapping[str, Path], run_id: str
    ) -> None:
        self._client = client
        self._experiment = experiment
        self._deadline = time.monotonic() + PUBLISH_SECONDS
        self._began = int(files["spec.json"].stat().st_mtime * 1000)
        self._ended = int(max(path.stat().st_mtime for path in files.values()) * 1000)
        self._found: dict[tuple[str, ...], list[Run]] = defaultdict(list)
        query = f"tags.`{RUN_ID}` = '{run_id}'"
        for run in client.search_runs([experiment], query, max_results=5000):
            self._found[tuple(run.data.tags.get(tag, "") for tag in IDENTITY)].append(run)

    def write(self, parent: RunView, children: Sequence[RunView]) -> None:
        """The parent's status comes last: until then a kill leaves it RUNNING, to be resumed."""
        above = self._take(parent, {})
        self._fill(above, parent)
        for child in children:
            run = self._take(child, {"mlflow.parentRunId": above.info.run_id})
            self._fill(run, child)
            self._settle(run, child.status)
        for stale in [run for runs in self._found.values() for run in runs]:
            self._retire(stale)
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
        for metrics in _batches(_metrics(run, view), METRIC_BATCH):
            self._check_time()
            self._client.log_batch(run_id, metrics=metrics)
        for params in _batches([Param(*item) for item in view.params.items()], BATCH):
            self._client.log_batch(run_id, params=params)
        if view.datasets:
            self._client.log_inputs(run_id, datasets=[_dataset(entry) for entry in view.datasets])
        for name, path in view.files.items():
            self._check_time()
            folder = Path(name).parent.as_posix()
            self._client.log_artifact(run_id, str(path), None if folder == "." else folder)
        for tags in _batches([RunTag(*item) for item in view.tags.items()], BATCH):
            self._client.log_batch(run_id, tags=tags)
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
        if time.monotonic() > self._deadline:
            raise TrackingError(f"it took more than {PUBLISH_SECONDS:.0f} s")


def _metrics(run: Run, view: RunView) -> list[Any]:
    """Numbers that changed, and all curves in the order of their steps.

    MLflow drops a row that it has already, timestamp included: curves carry the run's start time.
    A number that changed needs a later time to replace the old one.
    """
    from mlflow.entities import Metric

    now = int(time.time() * 1000)
    known = run.data.metrics
    changed = [Metric(k, v, now, 0) for k, v in view.numbers.items() if known.get(k) != v]
    points = [
        Metric(key, value, run.info.start_time, step)
        for key, curve in view.curves.items()
        for step, value in curve
    ]
    return changed + sorted(points, key=lambda point: point.step)


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
