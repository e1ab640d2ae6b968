"""Cores that a process may use: affinity and the quotas of control groups."""

import math
import os
import sys
from pathlib import Path

import pytest

from orchestrator import cores
from orchestrator.cores import cgroup_quota, usable_cores

INSIDE = "9:cpuset:/\n0::/jobs/ours\n"  # version 1's lines do not count


@pytest.fixture
def own(tmp_path: Path) -> Path:
    file = tmp_path / "cgroup"
    file.write_text(INSIDE)
    return file


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "fs/jobs/ours").mkdir(parents=True)
    return tmp_path / "fs"


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({}, math.inf),
        ({"jobs/ours": "max 100000"}, math.inf),
        ({"jobs/ours": "250000 100000"}, 2.5),
        ({"jobs/ours": "400000 100000", "jobs": "300000 200000"}, 1.5),
        ({"": "100000 50000", "jobs": "max 100000"}, 2.0),  # as a container sees its own
    ],
)
def test_the_tightest_quota_of_all_levels_counts(
    root: Path, own: Path, limits: dict[str, str], expected: float
) -> None:
    for group, limit in limits.items():
        (root / group / "cpu.max").write_text(limit + "\n")
    (root.parent / "cpu.max").write_text("1 100000")  # not a control group
    assert cgroup_quota(root, own) == expected


def test_without_control_groups_there_is_no_quota(tmp_path: Path) -> None:
    assert cgroup_quota(tmp_path, tmp_path / "none") == math.inf


@pytest.mark.parametrize(("quota", "expected"), [("250000", 2), ("50000", 1), ("900000", 4)])
def test_quotas_are_rounded_down_to_one_core_at_least(
    root: Path, own: Path, monkeypatch: pytest.MonkeyPatch, quota: str, expected: int
) -> None:
    (root / "cpu.max").write_text(f"{quota} 100000")
    monkeypatch.setattr(cores, "CGROUPS", root)
    monkeypatch.setattr(cores, "OWN_CGROUP", own)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(4)), raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    assert usable_cores() == expected


@pytest.mark.skipif(sys.platform != "linux", reason="affinity is Linux's")
def test_a_process_that_is_bound_to_one_core_has_one() -> None:
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        assert usable_cores() == 1
    finally:
        os.sched_setaffinity(0, allowed)
