"""How many cores this process may use."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path

from orchestrator.errors import UsageError

CGROUPS = Path("/sys/fs/cgroup")
OWN_CGROUP = Path("/proc/self/cgroup")
MOST_ON_A_CORE = 8  # workers: each holds a copy of torch and of a simulator


def usable_cores() -> int:
    """Cores on which the process may run, as far as its control groups let it use them."""
    allowed = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1
    return max(1, int(min(allowed, cgroup_quota(CGROUPS, OWN_CGROUP))))


def cgroup_quota(root: Path, own: Path) -> float:
    """How many cores' time control groups (version 2) allow, all levels above included.

    Infinite without a limit, with control groups of version 1, and where there are none.
    """
    try:
        lines = own.read_text(encoding="utf-8").splitlines()
    except OSError:
        return math.inf
    groups = [root / line.removeprefix("0::/") for line in lines if line.startswith("0::/")]
    levels = [level for group in groups for level in (group, *group.parents)]
    return min((_limit(level) for level in levels if level.is_relative_to(root)), default=math.inf)


def _limit(group: Path) -> float:
    """From cpu.max, "QUOTA PERIOD" in microseconds, where QUOTA may be "max"."""
    try:
        quota, period = (group / "cpu.max").read_text(encoding="utf-8").split()
    except OSError:  # the topmost group has none
        return math.inf
    return math.inf if quota == "max" else int(quota) / int(period)


def check_workers(workers: int | None, address: str | None) -> None:
    """Raise UsageError for a number that nothing could have, or not this machine without a cluster.

    address: of the cluster that they are to be on.
    """
    if workers is None:
        return
    if workers < 1:
        raise UsageError(f"--workers must be at least 1: {workers}")
    cores = usable_cores()
    if address is None and workers > MOST_ON_A_CORE * cores:
        raise UsageError(
            f"--workers {workers}: at most {MOST_ON_A_CORE * cores} on this machine's "
            f"{cores} cores; for more, give the --address of a Ray cluster"
        )
