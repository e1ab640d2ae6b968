"""What was published: a note in the run directory that tells whether there is anything new."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from analysis.schema import DATASETS, EPISODES, PROVENANCE, SPEC, TRAINING
from orchestrator.storage.store import write_atomically

Status = Literal["RUNNING", "FINISHED", "FAILED", "KILLED"]

DATED = (PROVENANCE, "report/index.html")
"""Files that tell when they were written, and so cannot tell whether there is anything new."""


@dataclass(frozen=True)
class Receipt:
    """`tracking.json`: what the last publish left in MLflow. Delete it to publish anew."""

    uri: str
    published: str  # digest of the files; "" from the start of a publish until its success
    status: Status


def published_files(run_dir: Path) -> dict[str, Path]:
    """All files that the view is made from, by their path inside the run directory."""
    names = (SPEC, PROVENANCE, TRAINING, DATASETS, EPISODES)
    paths = [run_dir / name for name in names] + sorted((run_dir / "report").rglob("*"))
    return {str(path.relative_to(run_dir)): path for path in paths if path.is_file()}


def news(run_dir: Path) -> str:
    """What a publish depends on, as a digest."""
    files = published_files(run_dir)
    return digest({name: path for name, path in files.items() if name not in DATED})


def digest(files: Mapping[str, Path]) -> str:
    """Hash of names and contents."""
    total = hashlib.sha256()
    for name, path in files.items():
        total.update(f"{name}:{hashlib.sha256(path.read_bytes()).hexdigest()};".encode())
    return total.hexdigest()


def read_json(path: Path, default: Any) -> Any:
    """The content of a JSON file; the default where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else default


def read_receipt(run_dir: Path) -> Receipt | None:
    """What MLflow has seen of a run; None where that is not known."""
    try:
        return Receipt(**json.loads((run_dir / "tracking.json").read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None  # an unreadable receipt only costs a publish


def write_receipt(run_dir: Path, receipt: Receipt) -> None:
    """Remember what MLflow has seen of a run."""
    write_atomically(run_dir / "tracking.json", json.dumps(asdict(receipt), indent=1).encode())
