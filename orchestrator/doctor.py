"""What `skillstitch doctor` looks at: whether this machine can do the work, and if not, why.

Each check reads one thing of the machine and hands it to a pure function that judges it.
"""

from __future__ import annotations

import ctypes.util
import errno
import fcntl
import importlib.metadata
import os
import platform
import shutil
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from rich.table import Table
from rich.text import Text

Status = Literal["ok", "warn", "fault"]

DISTRIBUTION = "skillstitch"
PYTHON = SpecifierSet(">=3.11,<3.12")
SQLITE = (3, 31)  # MLflow's schema has computed columns
GIB = 2**30
LEAST_DISK, ENOUGH_DISK = 1 * GIB, 10 * GIB
LEAST_MEMORY, ENOUGH_MEMORY = 2 * GIB, 8 * GIB
ENOUGH_SHARED_MEMORY = 1 * GIB

REASONS = {
    "mujoco": "3.10 and later break robosuite and gymnasium-robotics",
    "numpy": "robosuite's kinematics need numpy 1",
    "torch": "another version may change the bytes of every result",
}
"""Why a pin is there, where it is not just the version that was tested."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; `advice` is empty where all is well."""

    name: str
    status: Status
    found: str
    advice: str = ""


def diagnose(root: Path) -> list[Finding]:
    """Look at everything; `root` is where runs and artifacts are to be kept.

    A check that breaks is a fault of its own and keeps no other from running.
    """
    checks: dict[str, Callable[[], Iterable[Finding]]] = {
        "Python": lambda: [judge_python(platform.python_version())],
        "packages": check_packages,
        "cores": lambda: [judge_cores(usable_cores(), os.environ.get("OMP_NUM_THREADS"))],
        "memory": lambda: [judge_memory(total_memory())],
        "shared memory": lambda: [check_shared_memory()],
        "GPU": lambda: [check_gpu()],
        "disk": lambda: check_root(root),
        "SQLite": lambda: [judge_sqlite(sqlite3.sqlite_version_info)],
        "rendering": lambda: [judge_rendering(rendering_libraries())],
        "self test": lambda: [check_training()],
    }
    return [finding for name, check in checks.items() for finding in _guarded(name, check)]


def _guarded(name: str, check: Callable[[], Iterable[Finding]]) -> list[Finding]:
    try:
        return list(check())
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        return [Finding(name, "fault", reason, "install the packages again, then run doctor again")]


def has_faults(findings: Iterable[Finding]) -> bool:
    return any(finding.status == "fault" for finding in findings)


# --- Python and packages -----------------------------------------------------------------------


def judge_python(version: str) -> Finding:
    if version in PYTHON:
        return Finding("Python", "ok", version)
    return Finding("Python", "fault", version, f"use Python {PYTHON}: robosuite's pins need it")


def check_packages() -> list[Finding]:
    """Every requirement of the installed distribution that applies here."""
    try:
        required = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        advice = "run `pip install -e .` in the source tree"
        return [Finding(DISTRIBUTION, "fault", "not installed", advice)]
    requirements = [Requirement(line) for line in required]
    needed = [r for r in requirements if r.marker is None or r.marker.evaluate({"extra": ""})]
    return [judge_package(requirement, installed(requirement.name)) for requirement in needed]


def installed(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def judge_package(requirement: Requirement, version: str | None) -> Finding:
    name = requirement.name
    if version is not None and requirement.specifier.contains(version, prereleases=True):
        return Finding(name, "ok", version)
    because = f": {REASONS[name]}" if name in REASONS else ""
    advice = f'run `pip install "{name}{requirement.specifier}"`{because}'
    return Finding(name, "fault", version or "not installed", advice)


# --- The machine -------------------------------------------------------------------------------


def usable_cores() -> int:
    """Cores this process may run on, which a container or a batch system may restrict."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def judge_cores(cores: int, omp_threads: str | None) -> Finding:
    found = f"{cores} usable, OMP_NUM_THREADS {omp_threads or 'not set'}"
    if omp_threads in (None, "", "1"):
        return Finding("cores", "ok", found)
    advice = "unset OMP_NUM_THREADS: with one worker a core, more threads only slow them down"
    return Finding("cores", "warn", found, advice)


def total_memory() -> int:
    """What the machine has, or what its container is allowed."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = Path("/sys/fs/cgroup/memory.max")
    allowed = limit.read_text().strip() if limit.is_file() else "max"
    return machine if allowed == "max" else min(machine, int(allowed))


def judge_memory(size: int) -> Finding:
    found = f"{size / GIB:.1f} GiB"
    if size < LEAST_MEMORY:
        return Finding("memory", "fault", found, f"use a machine with {gib(LEAST_MEMORY)} or more")
    if size < ENOUGH_MEMORY:
        return Finding("memory", "warn", found, "use few workers: each takes about 0.5 GiB")
    return Finding("memory", "ok", found)


def check_shared_memory() -> Finding:
    folder = Path("/dev/shm")
    if not folder.is_dir():
        return Finding("shared memory", "ok", "not used on this system")
    return judge_shared_memory(shutil.disk_usage(folder).free)


def judge_shared_memory(free: int) -> Finding:
    found = f"{free / GIB:.1f} GiB free in /dev/shm"
    if free >= ENOUGH_SHARED_MEMORY:
        return Finding("shared memory", "ok", found)
    advice = "Ray keeps its objects on disk instead, slowly; in Docker give --shm-size=2g"
    return Finding("shared memory", "warn", found, advice)


def check_gpu() -> Finding:
    import torch

    if not torch.cuda.is_available():
        return Finding("GPU", "ok", "none; none is needed")
    names = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
    return Finding("GPU", "ok", ", ".join(names))


def rendering_libraries() -> list[str]:
    return [name for name in ("EGL", "OSMesa", "GL") if ctypes.util.find_library(name)]


def judge_rendering(libraries: list[str]) -> Finding:
    if libraries:
        return Finding("rendering", "ok", ", ".join(libraries))
    advice = "only pictures of episodes need it: install libegl1 or libosmesa6"
    return Finding("rendering", "warn", "no EGL, OSMesa or GL library", advice)


# --- Where runs are kept -----------------------------------------------------------------------


def check_root(root: Path) -> list[Finding]:
    """Room, and whether files, locks and databases work there: network disks may lack some."""
    try:
        root.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".doctor-", dir=root) as folder:
            findings = [check_locks(Path(folder)), check_wal(Path(folder))]
    except OSError as error:
        advice = "choose another --out, or make this a directory that you may write to"
        return [Finding("writing", "fault", f"{root}: {error.strerror}", advice)]
    return [
        Finding("writing", "ok", str(root)),
        judge_disk(shutil.disk_usage(root).free),
        *findings,
    ]


def judge_disk(free: int) -> Finding:
    found = f"{free / GIB:.1f} GiB free"
    if free < LEAST_DISK:
        return Finding("disk", "fault", found, f"free {gib(LEAST_DISK)}, or choose another --out")
    if free < ENOUGH_DISK:
        advice = f"enough for a smoke run; a full reproduction wants {gib(ENOUGH_DISK)}"
        return Finding("disk", "warn", found, advice)
    return Finding("disk", "ok", found)


def check_locks(folder: Path) -> Finding:
    """A lock that is held must keep a second one out, or two launches would share a run."""
    with (folder / "lock").open("w") as first, (folder / "lock").open("w") as second:
        try:
            fcntl.flock(first, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.flock(second, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno == errno.EWOULDBLOCK:
                return Finding("file locks", "ok", "work")
    advice = "keep runs on a local disk: two launches here could damage each other"
    return Finding("file locks", "fault", "do not work", advice)


def check_wal(folder: Path) -> Finding:
    with closing(sqlite3.connect(folder / "database")) as connection:
        (mode,) = connection.execute("PRAGMA journal_mode=WAL").fetchone()
        connection.execute("CREATE TABLE t (x)")
    if mode == "wal":
        return Finding("SQLite WAL", "ok", "works")
    return Finding("SQLite WAL", "fault", f"journal mode {mode}", "keep runs on a local disk")


def judge_sqlite(version: tuple[int, ...]) -> Finding:
    found = ".".join(map(str, version))
    if version >= SQLITE:
        return Finding("SQLite", "ok", found)
    wanted = ".".join(map(str, SQLITE))
    return Finding("SQLite", "fault", found, f"use a Python built with SQLite {wanted} or later")


# --- Self test ---------------------------------------------------------------------------------


def check_training() -> Finding:
    """Train a tiny agent of the maze twice: the bytes must agree."""
    start = time.monotonic()
    try:
        first, second = train_tiny_agent(), train_tiny_agent()
    except FloatingPointError as error:
        advice = "install the pinned torch again; if it stays, this CPU or its drivers are at fault"
        return Finding("self test", "fault", str(error), advice)
    return judge_determinism(first, second, time.monotonic() - start)


def train_tiny_agent() -> dict[str, bytes]:
    """Weights by name; raises FloatingPointError if a loss is not finite."""
    import numpy as np

    from stitching.data.experience import skill_experience
    from stitching.data.maze import MazeDataConfig, skill_demonstrations
    from stitching.envs.maze import MAZE
    from stitching.models.iql import IQLConfig, train_iql

    data = skill_demonstrations(MAZE, MazeDataConfig(episodes=3), 0)
    conditions = np.array([skill.condition for skill in MAZE.skills], dtype=np.float32)
    config = IQLConfig(updates=20, batch_size=32, members=2, width=16, log_every=5)
    trained = train_iql(skill_experience(data, conditions), MAZE.actions, config, "doctor")
    return {name: weight.tobytes() for name, weight in trained.weights.items()}


def judge_determinism(first: object, second: object, seconds: float) -> Finding:
    if first == second:
        return Finding("self test", "ok", f"two trainings gave the same bytes ({seconds:.1f} s)")
    advice = "set OMP_NUM_THREADS=1 and install the pinned torch; until then runs do not repeat"
    return Finding("self test", "fault", "two trainings gave different bytes", advice)


# --- Rendering ---------------------------------------------------------------------------------

STYLES = {"ok": "green", "warn": "yellow", "fault": "bold red"}


def as_table(findings: Iterable[Finding]) -> Table:
    """For a terminal."""
    table = Table("", "Looked at", "Found", "What to do", box=None)
    for finding in findings:
        status = Text(finding.status, style=STYLES[finding.status])
        # Text, because advice has brackets that rich would take for markup.
        table.add_row(status, finding.name, Text(finding.found), Text(finding.advice))
    return table


def as_lines(findings: Iterable[Finding]) -> list[str]:
    """For logs: "fault  numpy: 2.1.0; run …"."""
    return [
        f"{finding.status:<5}  {finding.name}: {'; '.join(filter(None, said))}"
        for finding in findings
        for said in [(finding.found, finding.advice)]
    ]


def gib(size: int) -> str:
    return f"{size // GIB} GiB"
