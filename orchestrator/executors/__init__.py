"""Executors: where jobs run. `open_executor` chooses one."""

from __future__ import annotations

import os
from typing import Literal

from orchestrator.executors.protocol import Executor

ExecutorKind = Literal["ray", "serial"]


def open_executor(
    kind: ExecutorKind, workers: int | None, address: str | None, dashboard: bool = False
) -> Executor:
    """Each is imported only when asked for: Ray and torch take seconds.

    Raises UsageError when there is no cluster at `address`, and where a dashboard is asked for and
    what Ray needs for it is not installed.
    """
    if kind == "serial":
        from orchestrator.executors.serial import SerialExecutor

        return SerialExecutor()
    if address is None:
        # Ray decides at import whether its servers listen on all interfaces or on loopback alone.
        # This switch, named for other systems, is how one asks for loopback on Linux too.
        os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"
    from orchestrator.executors.ray import RayExecutor

    return RayExecutor(workers, address, dashboard)
