"""`make` for people who are not root."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_a_browser_is_not_installed_by_who_is_not_root(tmp_path: Path) -> None:
    """It is said in a line, and the tests go on; root has it installed."""
    (tmp_path / "id").write_text("#!/bin/sh\necho 1000\n")
    (tmp_path / "apt-get").write_text("#!/bin/sh\nexit 1\n")
    for command in tmp_path.iterdir():
        command.chmod(0o755)
    make = [
        "/usr/bin/env",
        f"PATH={tmp_path}",
        shutil.which("make") or "make",
        "--silent",
        "browser",
    ]
    answer = subprocess.run(make, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == (
        "no chromium, and only root can install it: the tests of reports in a browser are skipped\n"
    )
    (tmp_path / "chromium").touch(mode=0o755)
    assert subprocess.run(make, cwd=ROOT, capture_output=True, check=True).stdout == b""
