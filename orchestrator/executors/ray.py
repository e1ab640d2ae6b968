"""Ray: stateless tasks train, one actor a core plays blocks (here or on a cluster)."""

from __future__ import annotations

import logging
import os
import sys
from collections import deque
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from orchestrator import libraries
from orchestrator.cores import usable_cores
from orchestrator.errors import UsageError
from orchestrator.executors.address import check_answer
from orchestrator.interruption import own_handler_kept
from orchestrator.storage.store import Artifact
from orchestrator.work.jobs import BuildJob, Job, PlayJob, Report

# Read by Ray when it is imported and started.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")

OBJECT_STORE_BYTES = 512 * 2**20
JOBS_PER_WORKER = 2  # one running, one waiting, so that no worker idles between jobs
SECONDS_BETWEEN_CHECKS = 5.0  # for nodes that have gone, where no job finishes

import ray  # noqa: E402
from ray._private.utils import read_ray_address  # noqa: E402
from ray.exceptions import RayError  # noqa: E402


@ray.remote(num_cpus=1, max_retries=0)
def _build(job: BuildJob, roles: list[str], *artifacts: Artifact) -> Report:
    libraries.give_places()
    from orchestrator.work.worker import build, use_one_thread

    use_one_thread()
    return build(job, dict(zip(roles, artifacts, strict=True)))


@ray.remote(num_cpus=1, max_restarts=0)
class _Player:
    """A block player with the artifacts it has been shown so far."""

    def __init__(self) -> None:
        libraries.give_places()
        from orchestrator.work.playing import BlockPlayer
        from orchestrator.work.worker import use_one_thread

        use_one_thread()
        self._player = BlockPlayer()
        self._artifacts: dict[str, Artifact] = {}

    def play(self, job: PlayJob, references: dict[str, Any]) -> Report:
        for key in {key for task, _ in job.tasks for key in task.artifacts.values()}:
            if key not in self._artifacts:
                self._artifacts[key] = ray.get(references[key])
        return self._player.play(job, self._artifacts)


@dataclass(eq=False)
class _Slot:
    """One actor and how many jobs it has been given."""

    actor: Any
    jobs: int = 0
    started: bool = False  # it has finished a job


@dataclass
class _Flight:
    """A job under way; builds have no slot."""

    job: Job
    slot: _Slot | None = field(default=None)


class RayExecutor:
    """Runs on this machine's cores, or on the cluster at `address`."""

    def __init__(
        self, workers: int | None = None, address: str | None = None, dashboard: bool = False
    ) -> None:
        self._owned = not ray.is_initialized()
        if self._owned:
            _start(workers, address, dashboard)
        self._most_workers = workers
        self.workers = self._capacity()
        self._references: dict[str, Any] = {}
        self._slots: list[_Slot] = []
        self._waiting: deque[PlayJob] = deque()
        self._flights: dict[Any, _Flight] = {}

    def provide(self, key: str, artifact: Artifact) -> None:
        self._references[key] = ray.put(artifact)

    def submit(self, job: Job) -> None:
        if isinstance(job, BuildJob):
            self._release_slots()
            roles = list(job.recipe.inputs)
            inputs = [self._references[key] for key in job.recipe.inputs.values()]
            self._flights[_build.remote(job, roles, *inputs)] = _Flight(job)
        else:
            self._waiting.append(job)
            self._assign_waiting()

    def next(self) -> Report:
        reference = self._first_ready()
        try:
            report: Report = ray.get(reference)
        except RayError as error:
            report = Report(self._lose(reference), trouble="lost", error=_first_line(error))
        else:
            slot = self._flights.pop(reference).slot
            if slot is not None:
                slot.jobs -= 1
                slot.started = True
        self._assign_waiting()
        return report

    def close(self) -> None:
        for slot in list(self._slots):
            self._dismiss(slot)
        for reference in self._flights:  # builds: the actors' jobs went with them
            ray.cancel(reference, force=True)
        self._flights.clear()
        self._waiting.clear()
        if self._owned:
            ray.shutdown()

    def _first_ready(self) -> Any:
        while True:
            ready, _ = ray.wait(list(self._flights), num_returns=1, timeout=SECONDS_BETWEEN_CHECKS)
            if ready:
                return ready[0]
            self._dismiss_the_stranded()

    def _dismiss_the_stranded(self) -> None:
        """Actors for which a lost node has left no core never start: others take their jobs."""
        self.workers = self._capacity()
        surplus = max(0, len(self._slots) - self.workers)
        for slot in [slot for slot in self._slots if not slot.started][:surplus]:
            self._waiting.extendleft(reversed(self._dismiss(slot)))
        self._assign_waiting()

    def _lose(self, reference: Any) -> Job:
        """The job whose worker died. What waited behind it is innocent and goes to another."""
        slot = self._flights[reference].slot
        if slot is None:
            job: Job = self._flights.pop(reference).job
        else:
            job, *behind = self._dismiss(slot)
            self._waiting.extendleft(reversed(behind))
        self.workers = self._capacity()
        return job

    def _dismiss(self, slot: _Slot) -> list[PlayJob]:
        """End an actor; returns the jobs it still had, the one it was busy with first."""
        self._slots.remove(slot)
        ray.kill(slot.actor)
        flights = [item for item in self._flights.items() if item[1].slot is slot]
        for reference, _ in flights:
            del self._flights[reference]
        return [flight.job for _, flight in flights if isinstance(flight.job, PlayJob)]

    def _capacity(self) -> int:
        """Cores of all nodes that are alive, up to what was asked for."""
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        return min(cores, self._most_workers or cores)

    def _assign_waiting(self) -> None:
        """Hand waiting jobs to the least busy actors, hiring actors up to the number of workers."""
        while self._waiting:
            if len(self._slots) < self.workers:
                self._slots.append(_Slot(_Player.remote()))  # type: ignore[attr-defined]
            slot = min(self._slots, key=lambda slot: slot.jobs)
            if slot.jobs >= JOBS_PER_WORKER:
                return
            job = self._waiting.popleft()
            keys = {key for task, _ in job.tasks for key in task.artifacts.values()}
            references = {key: self._references[key] for key in keys}
            slot.jobs += 1
            self._flights[slot.actor.play.remote(job, references)] = _Flight(job, slot)

    def _release_slots(self) -> None:
        """Actors hold a core each; give them back so that training tasks can use them."""
        for slot in [slot for slot in self._slots if not slot.jobs]:
            self._dismiss(slot)


def _start(workers: int | None, address: str | None, dashboard: bool) -> None:
    common: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
    # A worker is one thread; more would change the bytes.
    environment = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    if address is not None:
        address = _started_here() if address == "auto" else address
        try:
            check_answer(address)
        except OSError as error:
            raise UsageError(f"no Ray cluster at {address}: {_first_line(error)}") from error
        there = {"env_vars": environment | {"MUJOCO_GL": "disable"}}  # no worker draws
        try:
            with own_handler_kept():
                ray.init(address=address, runtime_env=there, **common)
        except (OSError, ValueError, RuntimeError) as error:
            raise UsageError(
                f"something answers at {address}, but no Ray cluster lets this process in "
                f"({_first_line(error)}): where it asks for a token, as `ray start` does where a "
                "local run has left one, set RAY_AUTH_MODE=token and copy the head's "
                "~/.ray/auth_token here; its Ray must be this one's version, "
                f"{ray.__version__}"
            ) from error
        return
    os.environ.update(environment)
    libraries.give_ray_a_token()
    if dashboard:
        _check_dashboard()
    with own_handler_kept():
        started = ray.init(
            address="local",
            num_cpus=workers or usable_cores(),
            include_dashboard=dashboard,  # on loopback
            object_store_memory=OBJECT_STORE_BYTES,
            _temp_dir=libraries.ray_folder(),
            **common,
        )
    if dashboard:
        print(f"Ray's dashboard: http://{started.dashboard_url}", file=sys.stderr)


def _check_dashboard() -> None:
    """Without its packages Ray starts one that answers and shows nothing."""
    try:
        import_module("ray.dashboard.optional_deps")
    except ImportError as error:
        raise UsageError(
            f"--dashboard: {error.name} is not installed; run "
            f"`pip install 'ray[default]=={ray.__version__}'`"
        ) from error


def _started_here() -> str:
    """Where `ray start` put the head of this machine's cluster, which may be gone."""
    found = os.environ.get("RAY_ADDRESS") or read_ray_address()
    if not found:
        raise UsageError(
            "--address auto: no Ray was started on this machine (`ray start --head`), and "
            "RAY_ADDRESS is not set; name the head, as in --address HEAD:6379"
        )
    return found


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0] if lines else ''}"
