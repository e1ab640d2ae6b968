"""One finished tiny run a session, and copies of it to damage."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator import reproduction as reproducing
from orchestrator.executors import open_executor
from orchestrator.spec.spec import Spec
from orchestrator.work.plan import Plan, make_plan
from tests.orchestrator.tiny import Counted, Place, promised_bytes, tiny_spec


@pytest.fixture(scope="session")
def spec() -> Spec:
    return tiny_spec()


@pytest.fixture(scope="session")
def plan(spec: Spec) -> Plan:
    return make_plan(spec)


@pytest.fixture
def place(tmp_path: Path) -> Place:
    """Nothing there yet."""
    return Place(tmp_path)


@pytest.fixture(scope="session")
def finished(spec: Spec, tmp_path_factory: pytest.TempPathFactory) -> Place:
    """The tiny run, undisturbed; shared by all tests, so read only."""
    place = Place(tmp_path_factory.mktemp("finished"))
    place.carry_out(spec)
    return place


@pytest.fixture
def done(finished: Place, tmp_path: Path) -> Place:
    """A copy of the finished run, to do with as a test likes."""
    return finished.copied(tmp_path / "done")


@pytest.fixture
def trained(finished: Place, tmp_path: Path) -> Place:
    """Every artifact is there, nothing is played yet."""
    return finished.trained(tmp_path / "trained")


@pytest.fixture(scope="session")
def shared_ray() -> Iterator[None]:
    """One Ray for all tests; executors opened meanwhile join it, up to the workers they ask for."""
    executor = open_executor("ray", 4, None)
    yield
    executor.close()


@pytest.fixture
def expected(finished: Place) -> dict[str, bytes]:
    return promised_bytes(finished.out)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    """The executor of every reproduction of this test."""
    executor = Counted()
    monkeypatch.setattr(reproducing, "open_executor", lambda *_: executor)
    return executor
