"""Publishing to a real MLflow server."""

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from orchestrator.tracking import default_uri, publish
from orchestrator.tracking.stores import SETTINGS
from tests.orchestrator.tracking.fake_run import CHILDREN, Seen


@pytest.fixture
def server(fresh_store: Path, tmp_path: Path) -> Iterator[str]:
    shutil.copy(fresh_store, tmp_path / "mlflow.db")
    with closing(socket.socket()) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    command = [sys.executable, "-m", "mlflow", "server", "--host", "127.0.0.1", "--workers", "1"]
    command += ["--port", str(port), "--backend-store-uri", default_uri(tmp_path)]
    command += ["--artifacts-destination", str(tmp_path / "served")]
    quiet = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", **SETTINGS}
    with (tmp_path / "server.log").open("w") as log:
        process = subprocess.Popen(command, env=os.environ | quiet, stdout=log, stderr=log)
    try:
        wait_until(lambda: answers(f"http://127.0.0.1:{port}/health"), seconds=120)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()


def wait_until(condition: Callable[[], bool], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=2) as response:
            return response.status == 200
    except OSError:
        return False


@pytest.mark.slow
def test_publishing_to_a_server(run_dir: Path, server: str) -> None:
    assert publish(run_dir, server, "RUNNING").ok
    assert publish(run_dir, server, "FINISHED").ok
    seen = Seen(server)
    assert seen.states() == ("FINISHED", {"FINISHED"})
    assert len(seen.children) == CHILDREN
    artifacts = {file.path for file in seen.client.list_artifacts(seen.parent.info.run_id)}
    assert artifacts == {"spec.json", "provenance.json", "report"}
    assert publish(run_dir, server, "FINISHED").skipped
