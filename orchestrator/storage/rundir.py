"""A run directory: self-contained, held by one process at a time, and true to one spec."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

import analysis
from orchestrator.benchmarks.registry import KITS
from orchestrator.errors import ChangedError, UsageError
from orchestrator.spec.methods import first_method, method_label, method_of
from orchestrator.spec.spec import Spec, TableSpec, differences, plain_spec, spec_from_plain
from orchestrator.spec.structure import Plain, to_plain
from orchestrator.storage import locking
from orchestrator.storage.ledger import Ledger
from orchestrator.storage.provenance import matters
from orchestrator.storage.store import USUAL_STORE, write_atomically
from orchestrator.work.plan import Plan, make_plan

SWEEP = "sweep.json"
REPORT_SOURCES = (".py", ".csv", ".html", ".css", ".js")


class RunDirectory:
    """Paths and small files of one run.

    spec.json         what was asked, resolved
    identity.json     id of this run, and the versions that must not change under it
    store.json        path of the store that it was last carried out over
    ledger.sqlite     every finished block
    provenance.json   where, when and with what it was made
    segments.parquet, episodes.parquet, training.json, datasets.json, report/
    showcase.json, diagnosis.json, anatomy.json  what only figures need, where the benchmark has it
    quarantine.json   blocks that were given up
    seconds.json      where the time of the last command that did any work went
    finished          there when all of the above is
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def ledger(self, *, read_only: bool = False) -> Ledger:
        path = self.path / "ledger.sqlite"
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
    def played(self) -> bool:
        """Whether everything is played and written, with nothing given up."""
        return (self.path / "finished").is_file() and not self.read_json("quarantine.json")

    @property
    def finished(self) -> bool:
        """Whether, moreover, the report is the one that today's analysis would write."""
        return self.played and (self.path / "finished").read_text() == analysis_fingerprint()

    def mark(self, *, finished: bool) -> None:
        """Say that the readable files are complete, or that they are about to change."""
        if finished:
            write_atomically(self.path / "finished", analysis_fingerprint().encode())
        else:
            (self.path / "finished").unlink(missing_ok=True)

    def locked(self) -> AbstractContextManager[None]:
        """Hold the directory; LockedError at once, naming the holder, if somebody else does."""
        return locking.held(self.path)

    def settle(self, spec: Spec) -> str:
        """Claim the directory for a spec, or check that it is the same one; returns the run's id.

        Raises ChangedError naming what differs: a field, a package version, the code.
        """
        return self.claim(describe(spec), [make_plan(spec)], lambda: differences(self.spec(), spec))

    def claim(
        self, description: Plain, plans: Iterable[Plan], differing: Callable[[], list[str]]
    ) -> str:
        """As `settle`, for whatever is described; `differing` compares it with what is there.

        Its scores depend on what these plans make and play.
        """
        now = matters(plans)
        identity_path = self.path / "identity.json"
        if not identity_path.exists():
            identity = {"run_id": uuid.uuid4().hex, "matters": now}
            self.write_json("spec.json", description)
            self.write_json("identity.json", identity)
            return str(identity["run_id"])
        identity = json.loads(identity_path.read_text())
        changed = differing()
        before = identity["matters"]
        changed += [
            f"{name}: {before.get(name)} → {now[name]}"
            for name in sorted(now)
            if before.get(name) != now[name]
        ]
        if changed:
            raise ChangedError(
                f"{self.path} was made under something else; choose another --out (finished "
                "artifacts and blocks are shared), or go back to:\n  " + "\n  ".join(changed)
            )
        return str(identity["run_id"])

    def spec(self) -> Spec:
        """The spec this directory was made for. UsageError where there is no run."""
        return spec_from_plain(self.asked()["spec"], str(self.path / "spec.json"))

    def asked(self) -> Plain:
        """spec.json, of a run or a suite. UsageError where there is neither."""
        path = self.path / "spec.json"
        if not path.is_file():
            raise UsageError(f"{self.path} is no run directory: it has no spec.json")
        plain: Plain = json.loads(path.read_text())
        return plain

    def asked_sweep(self) -> Plain | None:
        """What was asked of the sweep that was begun here; None where none was."""
        plain: Plain | None = self.read_json(SWEEP)
        return plain

    def write_json(self, name: str, content: Any) -> None:
        text = json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False)
        # A path may be any bytes.
        write_atomically(self.path / name, (text + "\n").encode(errors="surrogateescape"))

    def read_json(self, name: str) -> Any:
        path = self.path / name
        if not path.is_file():
            return None
        return json.loads(path.read_text(encoding="utf-8", errors="surrogateescape"))


def analysis_fingerprint() -> str:
    """Hash of everything that turns a ledger into a report."""
    package = Path(analysis.__file__).parent
    files = sorted(path for path in package.rglob("*") if path.suffix in REPORT_SOURCES)
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def describe(spec: Spec) -> Plain:
    """The spec for readers of a run directory: resolved lists, and the spec itself."""
    return {
        "name": spec.name,
        "title": spec.title,
        "benchmark": spec.benchmark,
        "scale": spec.scale,
        "skills": spec.skill_names,
        "methods": [
            {
                "name": method,
                "label": method_label(method),
                "own_first_skill": bool(first_method(method, spec.rollout)),
                "models": list(method_of(method).models),
            }
            for method in spec.methods
        ],
        "seeds": list(range(spec.seeds)),
        "episodes": spec.episodes,
        "tasks": [">".join(task) for task in spec.all_tasks],
        "step_limits": {str(length): limit for length, limit in spec.step_limits.items()},
        "tables": [to_plain(table) | _title(spec, table) for table in spec.tables],
        "spec": plain_spec(spec),
    }


def _title(spec: Spec, table: TableSpec) -> Plain:
    """A table's title, which names its data where they are not the benchmark's usual ones."""
    label = KITS[spec.benchmark].label(spec.data)
    return {"title": f"{table.title or spec.title} ({label})"} if label else {}


class Named(Protocol):
    """A spec or a suite."""

    @property
    def name(self) -> str: ...

    @property
    def scale(self) -> str: ...


def default_out(asked: Named) -> Path:
    """runs/<name>-<scale>."""
    return Path("runs") / f"{asked.name}-{asked.scale}"
