"""One fresh store a session, copied for each test, and a finished run to publish."""

import shutil
from pathlib import Path

import pytest

from orchestrator.tracking import default_uri
from orchestrator.tracking.stores import connect, turn_to_write
from tests.orchestrator.tracking.fake_run import finish_run, start_run, train_run


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return finish_run(train_run(start_run(tmp_path / "run")))


@pytest.fixture(scope="session")
def fresh_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store")
    with turn_to_write(default_uri(folder)):
        connect(default_uri(folder))
    return folder / "mlflow.db"


@pytest.fixture
def uri(fresh_store: Path, tmp_path: Path) -> str:
    """A store of its own whose schema was not created anew, which takes seconds."""
    shutil.copy(fresh_store, tmp_path / "mlflow.db")
    return default_uri(tmp_path)
