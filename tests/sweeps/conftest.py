"""One finished tiny sweep a session, and its store for others to find things in."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.sweeps.tiny import promised, sweep_in, tiny_sweep


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny sweep, undisturbed; shared by all tests, so read only."""
    root = tmp_path_factory.mktemp("finished-sweep")
    sweep_in(root, tiny_sweep())
    return root


@pytest.fixture(scope="session")
def expected(finished: Path) -> dict[str, Any]:
    return promised(finished, tiny_sweep())


@pytest.fixture
def done(finished: Path, tmp_path: Path) -> Path:
    """A copy of the finished sweep, to do with as a test likes."""
    shutil.copytree(finished, tmp_path / "done")
    return tmp_path / "done"


@pytest.fixture
def trained(finished: Path, tmp_path: Path) -> Path:
    """Every artifact is there, nothing is played yet."""
    root = tmp_path / "trained"
    shutil.copytree(
        finished / "store", root / "store", ignore=shutil.ignore_patterns("blocks.sqlite*")
    )
    return root
