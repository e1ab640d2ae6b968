"""A run directory: self-contained, held by one process at a time, and true to one spec."""

from __future__ import annotations

import hashlib
import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

import analysis
from analysis.schema import QUARANTINE, SPEC, WRITTEN
from orchestrator.errors import StorageError, UsageError
from orchestrator.spec.structure import Plain
from orchestrator.storage import locking
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.store import USUAL_STORE, write_atomically

FINISHED = "finished"
PLANNED = "plan.json"
LEDGER = "ledger.sqlite"
TRACKING = "tracking.json"
SWEEP = "sweep.json"
REPORT_SOURCES = (".py", ".csv", ".html", ".css", ".js")


class RunDirectory:
    """Paths and small files of one run.

    spec.json         what was asked, resolved
    identity.json     id of this run, and the versions that must not change under it
    plan.json         the artifacts and the number of blocks that it takes
    store.json        path of the store that it was last carried out over
    ledger.sqlite     every finished block
    provenance.json   where, when and with what it was made
    segments.parquet, episodes.parquet, training.json, datasets.json, report/
    showcase.json, diagnosis.json, stitches.json  what only figures need, where the benchmark has it
    quarantine.json   blocks that were given up
    tracking.json     what MLflow has seen
    episodes/         films of single episodes
    seconds.json      where the time of the last command that did any work went
    finished          there when all of the above is: digests of what was written
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def ledger(self, *, read_only: bool = False) -> Ledger:
        path = self.path / LEDGER
        if read_only and not path.is_file():
            raise UsageError(f"{self.path} has no ledger yet: nothing was played there")
        return Ledger(path, read_only=read_only)

    @property
    def store_root(self) -> Path:
        """The store that it was last carried out over; the usual one where that is not known."""
        return Path(self.read_json("store.json") or USUAL_STORE)

    def uses(self, store_root: Path) -> None:
        """Remember the store."""
        if (path := str(store_root.resolve())) != self.read_json("store.json"):
            self.write_json("store.json", path)

    @property
    def written(self) -> bool:
        """Whether an end was come to, blocks given up or not, and all readable files written."""
        return bool(self._mark())

    @property
    def played(self) -> bool:
        """Whether everything is played and written, undamaged, with nothing given up."""
        mark = self._mark()
        return bool(mark) and self._intact(mark["written"]) and not self.read_json(QUARANTINE)

    @property
    def finished(self) -> bool:
        """Whether, moreover, the report is there, undamaged, as today's analysis would write it."""
        mark = self._mark()
        return (
            self.played
            and mark["analysis"] == analysis_fingerprint()
            and self._intact(mark["report"])
        )

    def mark(self, *, finished: bool) -> None:
        """Say that the readable files are complete, or that they are about to change."""
        if not finished:
            (self.path / FINISHED).unlink(missing_ok=True)
            return
        written = [self.path / name for name in WRITTEN]
        report = sorted((self.path / "report").rglob("*"))
        self.write_json(
            FINISHED,
            {
                "analysis": analysis_fingerprint(),
                "written": self._digests(written),
                "report": self._digests(report),
            },
        )

    def _mark(self) -> Plain:
        """What `mark` has written; nothing where it has not, or where that is damaged."""
        try:
            mark = self.read_json(FINISHED)
        except StorageError:
            return {}
        complete = isinstance(mark, dict) and {"analysis", "written", "report"} <= mark.keys()
        return mark if complete else {}

    def _digests(self, files: list[Path]) -> dict[str, str]:
        return {
            str(file.relative_to(self.path)): hashlib.sha256(file.read_bytes()).hexdigest()
            for file in files
            if file.is_file()
        }

    def _intact(self, digests: Plain) -> bool:
        return self._digests([self.path / name for name in digests]) == digests

    def locked(self) -> AbstractContextManager[None]:
        """Hold the directory; LockedError at once, naming the holder, if somebody else does."""
        return locking.held(self.path)

    def asked(self) -> Plain:
        """spec.json, of a run or a suite. UsageError where there is neither."""
        plain: Plain | None = self.read_json(SPEC)
        if plain is None:
            raise UsageError(f"{self.path} is no run directory: it has no spec.json")
        return plain

    @property
    def is_suite(self) -> bool:
        """Whether it holds several runs. UsageError where there is neither a run nor a suite."""
        return "parts" in self.asked()["spec"]

    @property
    def parts(self) -> dict[str, RunDirectory]:
        """The run directory of each part of a suite, made or not; none of a run."""
        parts = self.asked()["spec"].get("parts", [])
        return {part["label"]: self.part(part["label"]) for part in parts}

    def part(self, label: str) -> RunDirectory:
        """The run directory of a part, within its suite's."""
        return RunDirectory(self.path / "parts" / label)

    def asked_sweep(self) -> Plain | None:
        """What was asked of the sweep that was begun here; None where none was."""
        plain: Plain | None = self.read_json(SWEEP)
        return plain

    def write_json(self, name: str, content: Any) -> None:
        text = json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False)
        # A path may be any bytes.
        write_atomically(self.path / name, (text + "\n").encode(errors="surrogateescape"))

    def read_json(self, name: str) -> Any:
        """None where there is no such file. StorageError for one that cannot be read."""
        path = self.path / name
        try:
            return json.loads(path.read_text(encoding="utf-8", errors="surrogateescape"))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise StorageError(f"cannot read {path}: {error.strerror}; name another") from error
        except ValueError as error:
            raise StorageError(
                f"{path} is damaged: {error}; move it away and run the same command again, or "
                "choose another --out (finished artifacts and blocks are in the store)"
            ) from error


def analysis_fingerprint() -> str:
    """Hash of everything that turns a ledger into a report."""
    package = Path(analysis.__file__).parent
    files = sorted(path for path in package.rglob("*") if path.suffix in REPORT_SOURCES)
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


class Named(Protocol):
    """A spec or a suite."""

    @property
    def name(self) -> str: ...

    @property
    def scale(self) -> str: ...


def default_out(asked: Named) -> Path:
    """runs/<name>-<scale>."""
    return Path("runs") / f"{asked.name}-{asked.scale}"
