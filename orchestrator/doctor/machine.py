"""The machine: cores, memory, GPU and what rendering needs."""

from __future__ import annotations

import ctypes.util
import os
import shutil
from pathlib import Path

from orchestrator.doctor.finding import GIB, Finding, gib

LEAST_MEMORY, ENOUGH_MEMORY = 2 * GIB, 8 * GIB
ENOUGH_SHARED_MEMORY = 1 * GIB


def judge_cores(cores: int, omp_threads: str | None) -> Finding:
    """How many cores can be used, and whether threads would get in their way."""
    found = f"{cores} usable, OMP_NUM_THREADS {omp_threads or 'not set'}"
    if omp_threads in (None, "", "1"):
        return Finding("cores", "ok", found)
    advice = "unset OMP_NUM_THREADS: with one worker a core, more threads only slow them down"
    return Finding("cores", "warn", found, advice)


def total_memory() -> int:
    """What the machine has, or what its container is allowed."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = Path("/sys/fs/cgroup/memory.max")
    allowed = limit.read_text(encoding="utf-8").strip() if limit.is_file() else "max"
    return machine if allowed == "max" else min(machine, int(allowed))


def judge_memory(size: int) -> Finding:
    """Whether so many bytes are enough."""
    found = f"{size / GIB:.1f} GiB"
    if size < LEAST_MEMORY:
        return Finding("memory", "fault", found, f"use a machine with {gib(LEAST_MEMORY)} or more")
    if size < ENOUGH_MEMORY:
        return Finding("memory", "warn", found, "use few workers: each takes about 0.5 GiB")
    return Finding("memory", "ok", found)


def check_shared_memory() -> Finding:
    """Where Ray keeps its objects."""
    folder = Path("/dev/shm")
    if not folder.is_dir():
        return Finding("shared memory", "ok", "not used on this system")
    return judge_shared_memory(shutil.disk_usage(folder).free)


def judge_shared_memory(free: int) -> Finding:
    """Whether so many free bytes are enough."""
    found = f"{free / GIB:.1f} GiB free in /dev/shm"
    if free >= ENOUGH_SHARED_MEMORY:
        return Finding("shared memory", "ok", found)
    advice = "Ray keeps its objects on disk instead, slowly; in Docker give --shm-size=2g"
    return Finding("shared memory", "warn", found, advice)


def check_gpu() -> Finding:
    """Which GPUs torch sees; none is needed."""
    import torch

    if not torch.cuda.is_available():
        return Finding("GPU", "ok", "none; none is needed")
    names = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
    return Finding("GPU", "ok", ", ".join(names))


def rendering_libraries() -> list[str]:
    """Names of the libraries here that MuJoCo can draw with."""
    return [name for name in ("EGL", "OSMesa", "GL") if ctypes.util.find_library(name)]


def judge_rendering(libraries: list[str]) -> Finding:
    """Whether pictures of episodes can be drawn."""
    if libraries:
        return Finding("rendering", "ok", ", ".join(libraries))
    advice = "only pictures of episodes need it: install libegl1 or libosmesa6"
    return Finding("rendering", "warn", "no EGL, OSMesa or GL library", advice)
