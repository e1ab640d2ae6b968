"""Whether there is anything new to publish."""

import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.tracking import PublishOutcome, default_uri, publish
from orchestrator.tracking.receipt import DATED
from tests.orchestrator.tracking.fake_run import Seen


def test_unchanged_content_is_skipped_without_importing_mlflow(run_dir: Path, uri: str) -> None:
    assert publish(run_dir, uri, "FINISHED").ok
    code = (
        "import sys; from pathlib import Path; from orchestrator import tracking\n"
        f"run, uri = Path({str(run_dir)!r}), {uri!r}\n"
        "assert tracking.publish(run, uri, 'RUNNING').skipped\n"
        "assert tracking.publish(run, uri, 'FINISHED').skipped\n"
        "assert 'mlflow' not in sys.modules and 'pandas' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert Seen(uri).states()[0] == "FINISHED"


def test_what_is_published_again(run_dir: Path, uri: str, tmp_path: Path) -> None:
    def skipped(where: str = uri) -> bool:
        return publish(run_dir, where, "FINISHED").skipped

    assert not skipped()
    assert skipped()
    for dated in DATED:  # which alone are no news
        (run_dir / dated).write_text((run_dir / dated).read_text() + " ")
    assert skipped()
    (run_dir / "report" / "figures" / "scores.svg").write_text("another figure")
    assert not skipped()
    Path(uri.removeprefix("sqlite:///")).unlink()
    assert not skipped()  # the view is gone, the truth is not
    assert not skipped(default_uri(tmp_path / "elsewhere"))


@pytest.mark.parametrize("content", ["", "{", "[]", '{"uri": "x"}'])
def test_a_damaged_receipt_counts_as_none(run_dir: Path, uri: str, content: str) -> None:
    (run_dir / "tracking.json").write_text(content)
    assert not publish(run_dir, uri, "FINISHED").skipped


def test_a_run_that_never_began_has_nothing_to_show(run_dir: Path, uri: str) -> None:
    (run_dir / "provenance.json").unlink()
    skipped = PublishOutcome(ok=True, skipped=True)
    assert publish(run_dir, uri, "FAILED") == skipped
    assert not (run_dir / "tracking.json").exists()
