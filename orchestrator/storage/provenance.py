"""Where a result comes from: versions, revision, machine, times."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from orchestrator.builders.registry import BUILDERS
from orchestrator.cores import usable_cores
from orchestrator.spec.methods import method_label
from orchestrator.spec.structure import Plain
from orchestrator.work.plan import Plan
from orchestrator.work.recipes import NUMERIC_PACKAGES, code_fingerprint

REPORTED_PACKAGES = (
    "skillstitch",
    "torch",
    "numpy",
    "mujoco",
    "gymnasium-robotics",
    "robosuite",
    "ray",
    "optuna",
    "mlflow",
    "pandas",
)
SOURCES = ("stitching", "orchestrator", "sweeps", "analysis", "pyproject.toml", "constraints.txt")


def matters(plans: Iterable[Plan]) -> Plain:
    """What must not change under a run with these plans: code that its scores depend on."""
    made: dict[str, str] = {}
    played: dict[str, set[str]] = {}
    for plan in plans:
        for kind in plan.scored_kinds:
            builder = BUILDERS[kind]
            made[f"code that makes {kind}"] = code_fingerprint(builder.code, builder.setup)[:12]
        for blocks in plan.method_blocks.values():
            name = method_label(blocks.name) if blocks.name else "shared first skills"
            played.setdefault(f"code that plays {name}", set()).add(blocks.code[:12])
    packages = {name: importlib.metadata.version(name) for name in NUMERIC_PACKAGES}
    codes = {name: " ".join(sorted(several)) for name, several in played.items()}
    return made | codes | packages


def provenance() -> Plain:
    """Versions, source revision and machine, as a report prints them."""
    return {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version()}
        | {name: _version(name) for name in REPORTED_PACKAGES},
        "git_revision": git_revision(),
        "cpu": _cpu(),
        "cores": usable_cores(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def git_revision() -> str:
    """Commit of the source tree, marked when the sources have uncommitted changes.

    What a run itself writes, such as `results/`, does not count.
    """
    try:
        commit = _git("rev-parse", "--short=12", "HEAD")
        changes = _git("status", "--porcelain", "--", *SOURCES)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return f"{commit}-dirty" if changes else commit


def _git(*arguments: str) -> str:
    answer = subprocess.run(
        ["git", *arguments],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=10,
        check=True,
    )
    return answer.stdout.strip()


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
