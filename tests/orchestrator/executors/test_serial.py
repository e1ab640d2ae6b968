"""What the serial executor alone has to see to: it works in the caller's own process."""

import numpy as np
from threadpoolctl import threadpool_info

from orchestrator.executors.serial import SerialExecutor


def test_numpy_keeps_to_one_thread() -> None:
    """As in Ray's workers: several would wait for each other, and might change the bytes."""
    np.linalg.inv(np.eye(2))  # loads it
    SerialExecutor()
    threads = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    assert threads
    assert set(threads) == {1}
