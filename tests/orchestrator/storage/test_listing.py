"""`skillstitch list`, and `--version`."""

import importlib.metadata
import json
import shutil
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.errors import UsageError
from orchestrator.storage.listing import listing_lines
from orchestrator.storage.rundir import RunDirectory
from tests.orchestrator.tiny import Place


def told(directory: RunDirectory) -> str:
    return f"{directory.path.name} as its sweep says"


def test_every_run_has_a_line(finished: Place, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    shutil.copytree(finished.out, runs / "whole")
    shutil.copytree(finished.out, runs / "deep" / "stopped")
    (runs / "deep" / "stopped" / "finished").unlink()
    shutil.copytree(finished.out, runs / "whole" / "parts" / "a")
    (runs / "damaged").mkdir()
    (runs / "damaged" / "spec.json").write_text("{")
    (runs / "old").mkdir()
    (runs / "old" / "spec.json").write_text("{}")
    shutil.copytree(finished.out, runs / "store" / "agent" / "key")
    (runs / "store" / "blocks.sqlite").touch()
    shutil.copytree(finished.out, runs / "mlartifacts" / "0123" / "artifacts")
    damaged, stopped, old, whole = listing_lines(runs, told)
    assert "damaged: `skillstitch status` names the file" in damaged
    assert "its spec.json is damaged, or of another version" in old
    assert stopped.startswith(str(runs / "deep" / "stopped"))
    assert "tiny at paper scale" in stopped
    assert " blocks played" in stopped
    assert whole.split()[-4] == "finished"
    assert whole.endswith("UTC")


def test_a_sweep_tells_itself_how_far_it_is(finished: Place, tmp_path: Path) -> None:
    shutil.copytree(finished.out, tmp_path / "sweep")
    asked = {"name": "search", "scale": "quick"}
    (tmp_path / "sweep" / "sweep.json").write_text(json.dumps(asked))
    (line,) = listing_lines(tmp_path, told)
    assert "search at quick scale" in line
    assert "sweep as its sweep says" in line


def test_a_folder_without_a_run(tmp_path: Path) -> None:
    assert list(listing_lines(tmp_path, told)) == [f"no run in {tmp_path}"]
    with pytest.raises(UsageError, match="is no folder"):
        list(listing_lines(tmp_path / "nowhere", told))


def test_what_a_user_sees(finished: Place, capsys: pytest.CaptureFixture[str]) -> None:
    main(["list", str(finished.out.parent)])
    assert "finished" in capsys.readouterr().out
    main(["--version"])
    expected = f"skillstitch {importlib.metadata.version('skillstitch')}\n"
    assert capsys.readouterr().out == expected
