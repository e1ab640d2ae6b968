"""All checks, one after the other."""

from __future__ import annotations

import os
import platform
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path

from orchestrator.cores import usable_cores
from orchestrator.doctor import machine, packages, selftest, storage, surroundings
from orchestrator.doctor.finding import Finding


def diagnose(root: Path) -> list[Finding]:
    """Look at everything; `root` is where runs and artifacts are to be kept.

    A check that breaks is a fault of its own and keeps no other from running.
    """
    checks: dict[str, Callable[[], Iterable[Finding]]] = {
        "Python": lambda: [packages.judge_python(platform.python_version())],
        "packages": packages.check_packages,
        "places": surroundings.check_places,
        "cores": lambda: [machine.judge_cores(usable_cores(), os.environ.get("OMP_NUM_THREADS"))],
        "memory": lambda: [machine.judge_memory(machine.total_memory())],
        "shared memory": lambda: [machine.check_shared_memory()],
        "GPU": lambda: [machine.check_gpu()],
        "disk": lambda: storage.check_root(root),
        "SQLite": lambda: [packages.judge_sqlite(sqlite3.sqlite_version_info)],
        "rendering": lambda: [machine.judge_rendering(machine.rendering_libraries())],
        "MUJOCO_GL": surroundings.check_drawing,
        "self test": lambda: [selftest.check_training()],
    }
    imports = _guarded("imports", surroundings.check_imports)
    if any(finding.name == "importing torch" for finding in imports):
        del checks["GPU"], checks["self test"]  # it may end this process, too
    return imports + [
        finding for name, check in checks.items() for finding in _guarded(name, check)
    ]


def _guarded(name: str, check: Callable[[], Iterable[Finding]]) -> list[Finding]:
    try:
        return list(check())
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        return [Finding(name, "fault", reason, "install the packages again, then run doctor again")]
