"""One finished tiny run a session, and copies of it to damage."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from tiny import Lines, carry_out, tiny_spec

from orchestrator.ledger import Ledger
from orchestrator.plan import Plan, make_plan
from orchestrator.rundir import RunDirectory
from orchestrator.spec import Spec
from orchestrator.store import Store


@dataclass(frozen=True)
class Place:
    """A run directory and the store beside it."""

    root: Path

    @property
    def out(self) -> Path:
        return self.root / "run"

    @property
    def store_root(self) -> Path:
        return self.root / "store"

    @property
    def store(self) -> Store:
        return Store(self.store_root)

    @property
    def directory(self) -> RunDirectory:
        return RunDirectory(self.out)

    def shared(self) -> Ledger:
        return Ledger(self.store_root / "blocks.sqlite")

    def carry_out(self, spec: Spec, progress: Lines | None = None) -> RunDirectory:
        return carry_out(spec, self.out, self.store_root, progress)


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
    shutil.copytree(finished.root, tmp_path / "done")
    return Place(tmp_path / "done")


@pytest.fixture
def trained(finished: Place, tmp_path: Path) -> Place:
    """Every artifact is there, nothing is played yet."""
    place = Place(tmp_path / "trained")
    shutil.copytree(
        finished.store_root, place.store_root, ignore=shutil.ignore_patterns("blocks.sqlite*")
    )
    return place
