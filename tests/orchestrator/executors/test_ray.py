"""What is Ray's own: who may connect to it, and what becomes of the jobs of workers that die."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from orchestrator.errors import UsageError
from orchestrator.executors import open_executor
from orchestrator.executors import ray as ray_executor
from orchestrator.executors.protocol import Executor
from orchestrator.reproduction import Settings
from orchestrator.work.jobs import BlockTask, BuildJob, Job, PlayJob, Report
from orchestrator.work.plan import Plan
from tests.orchestrator.executors.processes import titled
from tests.orchestrator.tiny import Place

pytestmark = pytest.mark.ray

PLAYING = "ray::_Player.play"
BUILDING = "ray::_build"

LISTENERS = """
from orchestrator.executors import open_executor
executor = open_executor("ray", 1, None)
import os, pathlib
from tests.orchestrator.executors.processes import descendants, title
sockets = {}
for process in [os.getpid(), *descendants(os.getpid())]:
    for entry in pathlib.Path(f"/proc/{process}/fd").iterdir():
        try:
            sockets[os.readlink(entry)] = title(process)
        except OSError:
            pass
for table in ("tcp", "tcp6", "udp", "udp6"):
    for line in pathlib.Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
        fields = line.split()
        listening = fields[3] == "0A" or table.startswith("udp")
        if listening and f"socket:[{fields[9]}]" in sockets:
            print(table, fields[1].rpartition(":")[0])
executor.close()
"""
LOOPBACK = {"0100007F", "0000000000000000FFFF00000100007F", "00000000000000000000000001000000"}


def test_nothing_listens_beyond_loopback() -> None:
    """A process of its own, because Ray decides when it is imported."""
    environment = {name: text for name, text in os.environ.items() if not name.startswith("RAY_")}
    answer = subprocess.run(
        [sys.executable, "-c", LISTENERS],
        env=environment | {"PYTHONPATH": os.getcwd()},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    listeners = [line.split() for line in answer.stdout.splitlines()]
    assert len(listeners) >= 3  # Ray's control store, raylet and workers
    assert {address for _, address in listeners} <= LOOPBACK


def fresh() -> dict[str, str]:
    """The environment without what importing the executor has set here."""
    return {name: text for name, text in os.environ.items() if name != "RAY_AUTH_MODE"}


def refused(address: str, **environment: str) -> str:
    """What a user is told who cannot join a cluster."""
    script = (
        "from orchestrator.executors import open_executor\n"
        "from orchestrator.errors import UsageError\n"
        f"try:\n    open_executor('ray', None, {address!r}).close()\n"
        "except UsageError as error:\n    print(error)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", script],
        env=fresh() | {"RAY_gcs_rpc_server_reconnect_timeout_s": "1"} | environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return answer.stdout


def test_no_cluster_at_that_address() -> None:
    assert refused("127.0.0.1:1").startswith("no Ray cluster at 127.0.0.1:1: ")
    assert UsageError.exit_code == 2


def test_a_cluster_of_this_machine_that_is_gone(tmp_path: Path) -> None:
    """Ray itself tries for minutes."""
    told = refused("auto", RAY_TMPDIR=str(tmp_path), RAY_ADDRESS="")
    assert told.startswith("--address auto: no Ray was started on this machine")
    (tmp_path / "ray").mkdir()
    (tmp_path / "ray" / "ray_current_cluster").write_text("127.0.0.1:1")
    told = refused("auto", RAY_TMPDIR=str(tmp_path), RAY_ADDRESS="")
    assert told.startswith("no Ray cluster at 127.0.0.1:1: ")


def test_a_dashboard_without_its_packages_says_what_to_install() -> None:
    """Ray itself would start one that shows nothing."""
    if find_spec("aiohttp_cors") is not None:
        pytest.skip("they are installed")
    script = "from orchestrator.executors import open_executor; open_executor('ray', 1, None, True)"
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    last = answer.stderr.splitlines()[-1]
    assert last.startswith("orchestrator.errors.UsageError: --dashboard: aiohttp_cors is not inst")
    assert "pip install 'ray[default]==" in last


def test_a_dashboard_is_for_a_ray_of_its_own(tmp_path: Path) -> None:
    for other in ({"executor": "serial"}, {"address": "head:6379"}):
        with pytest.raises(UsageError, match="a cluster has its own"):
            Settings(tmp_path, dashboard=True, **other)  # type: ignore[arg-type]


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """The address of a head that asks for a token, and the home with that token."""
    home = tmp_path / "home"
    (home / ".ray").mkdir(parents=True)
    (home / ".ray" / "auth_token").write_text("0" * 64)
    with closing(socket.socket()) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [
        "ray", "start", "--head", "--block", f"--port={port}", "--include-dashboard=false",
        "--num-cpus=1", "--object-store-memory=100000000",
    ]  # fmt: skip
    with TemporaryDirectory(prefix="r") as short:  # Ray's sockets have long names
        head = subprocess.Popen(
            [Path(sys.executable).with_name(command[0]), *command[1:], f"--temp-dir={short}"],
            env=fresh() | {"HOME": str(home)},
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            _wait_for(port)
            yield f"127.0.0.1:{port}", home
        finally:
            os.killpg(head.pid, signal.SIGKILL)  # it would take half a minute to end by itself
            head.wait(60)


def _wait_for(port: int) -> None:
    for _ in range(300):
        with closing(socket.socket()) as attempt:
            if attempt.connect_ex(("127.0.0.1", port)) == 0:
                time.sleep(3)  # for the rest of it
                return
        time.sleep(0.2)
    raise TimeoutError(f"no Ray at port {port}")


@pytest.mark.slow
def test_a_cluster_that_asks_for_a_token_says_what_to_do(guarded: tuple[str, Path]) -> None:
    """A first local run leaves one, and `ray start` asks for it from then on."""
    address, home = guarded
    assert refused(address, HOME=str(home), RAY_AUTH_MODE="token") == ""
    told = refused(address, HOME=str(home))
    assert told.startswith(f"something answers at {address}")
    assert "set RAY_AUTH_MODE=token and copy the head's ~/.ray/auth_token" in told


@pytest.fixture
def solo(shared_ray: None, plan: Plan, finished: Place) -> Iterator[Executor]:
    """One worker, so that jobs wait behind each other."""
    executor = open_executor("ray", 1, None)
    for key, recipe in plan.recipes.items():
        executor.provide(key, finished.store.read(recipe.kind, key))
    yield executor
    executor.close()


def first_skills(plan: Plan) -> list[BlockTask]:
    return [plan.tasks[node, 0] for node in plan.roots()]


def endless(task: BlockTask) -> BlockTask:
    return replace(task, key="endless", episodes=(0, 10**6))


def kill(part: str) -> None:
    """As soon as a worker of ours is doing this, SIGKILL it."""
    deadline = time.monotonic() + 60
    while not (busy := titled(os.getpid(), part)):
        assert time.monotonic() < deadline, f"nobody is at {part}"
        time.sleep(0.02)
    for process in busy:
        os.kill(process, signal.SIGKILL)


def keys(report: Report) -> list[str]:
    assert isinstance(report.job, PlayJob)
    return [task.key for task, _ in report.job.tasks]


def test_a_killed_player_is_a_lost_report(solo: Executor, plan: Plan) -> None:
    first, second, *_ = first_skills(plan)
    solo.submit(PlayJob(((endless(first), None), (second, None))))
    kill(PLAYING)
    report = solo.next()
    assert report.trouble == "lost"
    assert report.blocks == ()
    assert keys(report) == ["endless", second.key]
    assert report.error

    solo.submit(PlayJob(((first, None), (second, None))))
    report = solo.next()
    assert report.trouble is None
    assert [block.outcome is not None for block in report.blocks] == [True, True]


def test_what_waits_behind_a_killed_job_is_innocent(solo: Executor, plan: Plan) -> None:
    first, *others = first_skills(plan)
    jobs: list[Job] = [PlayJob(((task, None),)) for task in [endless(first), *others]]
    for job in jobs:
        solo.submit(job)
    kill(PLAYING)
    found = [solo.next() for _ in jobs]
    assert [(report.trouble, keys(report)) for report in found] == [
        ("lost", ["endless"]),
        *((None, [task.key]) for task in others),
    ]


def test_a_killed_build_is_a_lost_report(solo: Executor, plan: Plan) -> None:
    recipe = plan.recipes[plan.by_seed("agent")[0]]
    config = recipe.params["config"] | {"updates": 10**6}
    slow = replace(recipe, params=recipe.params | {"config": config})
    solo.submit(BuildJob(slow))
    kill(BUILDING)
    report = solo.next()
    assert report.trouble == "lost"
    assert report.job == BuildJob(slow)

    solo.submit(BuildJob(recipe))
    assert solo.next().trouble is None


def test_actors_that_cannot_start_are_given_up(
    solo: Executor, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lost node takes its cores with it; an actor hired before that is known waits for ever."""
    monkeypatch.setattr(ray_executor, "SECONDS_BETWEEN_CHECKS", 0.5)
    solo.workers = 6  # type: ignore[misc]  # as it was believed to be; Ray here has 4 cores
    jobs = [PlayJob(((task, None),)) for task in first_skills(plan) * 3]
    for job in jobs:
        solo.submit(job)
    assert sorted(key for _ in jobs for key in keys(solo.next())) == sorted(
        task.key for task in first_skills(plan) * 3
    )
    assert solo.workers == 1
