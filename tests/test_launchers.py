"""Files that start skillstitch elsewhere: what of them can be checked without SLURM and Docker."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BATCH, IMAGE = (ROOT / "docs" / "examples" / name for name in ("cluster.sbatch", "Dockerfile"))


def test_the_batch_file_is_valid_shell() -> None:
    checked = subprocess.run(["bash", "-n", BATCH], capture_output=True, text=True)
    assert (checked.returncode, checked.stderr) == (0, "")


def test_the_batch_file_asks_for_what_it_uses() -> None:
    """SLURM sets these variables only where they are asked for, and reads options only on top."""
    text = BATCH.read_text()
    top, _, rest = text.partition("set -euo pipefail")
    asked = re.findall(r"^#SBATCH --([a-z-]+)", top, flags=re.MULTILINE)
    assert {"nodes", "cpus-per-task", "signal", "time"} <= set(asked)
    assert "#SBATCH" not in rest
    assert "SLURM_CPUS_PER_TASK" in rest


def test_the_image_copies_what_is_there() -> None:
    text = IMAGE.read_text()
    copied = [
        name for line in re.findall(r"^COPY (.*) \S+$", text, re.MULTILINE) for name in line.split()
    ]
    assert {"stitching", "orchestrator", "sweeps", "analysis", "pyproject.toml"} <= set(copied)
    for name in copied:
        assert (ROOT / name).exists()
    torch = re.findall(r'"(torch==\S+)"', (ROOT / "pyproject.toml").read_text())
    assert torch == re.findall(r"torch==[\d.]+", text)
