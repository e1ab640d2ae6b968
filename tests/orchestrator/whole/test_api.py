"""What Python sees: the promised names, and the examples that use them."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import orchestrator
from analysis.backends import CHOSEN
from orchestrator.errors import UsageError
from orchestrator.spec.spec import Spec
from tests.orchestrator.tiny import Place

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"


def test_the_promised_names_are_there() -> None:
    assert all(callable(getattr(orchestrator, name)) for name in orchestrator.__all__)
    assert orchestrator.__version__


def test_no_module_hides_a_promised_name() -> None:
    """A module `orchestrator.plan`, once imported, would take the place of the function."""
    assert not [name for name in orchestrator.__all__ if find_spec(f"orchestrator.{name}")]


def test_a_suite_is_no_spec_and_a_spec_is_no_suite() -> None:
    assert len(orchestrator.load_suite("table5", "smoke").parts) > 1
    with pytest.raises(UsageError, match="a suite of several runs"):
        orchestrator.load_spec("table5", "smoke")
    with pytest.raises(UsageError, match="table1 is no suite"):
        orchestrator.load_suite("table1", "smoke")


def test_a_library_to_draw_with_is_not_needed(
    spec: Spec, done: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a command; pictures are drawn by processes that get what the user has chosen."""
    monkeypatch.setenv(CHOSEN, "egl")
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    orchestrator.reproduce(
        spec, done.out, store=done.store_root, executor="serial", tracking_uri="none"
    )
    assert os.environ["MUJOCO_GL"] == "disable"


def output(example: str, *words: object) -> str:
    command = [sys.executable, str(EXAMPLES / example), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.slow
@pytest.mark.ray
def test_the_examples_of_tables_run(tmp_path: Path) -> None:
    table = output("reproduce_a_table.py", tmp_path)
    assert "60 tasks" in table
    assert "mb-stitch" in table
    own = output("own_table.py", tmp_path)
    assert "mb-stitch[alpha=20]" in own
    assert "g2 → g0" in own


def test_the_example_of_a_stitch_runs() -> None:
    lines = output("one_stitch_by_hand.py").splitlines()
    values = [float(line.split(" ± ")[0].split()[-1]) for line in lines]
    assert len(values) == 6
    assert values[-1] > values[0]
