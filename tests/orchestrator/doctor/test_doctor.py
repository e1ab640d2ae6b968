"""The doctor on this machine, and its judgement of machines that are worse."""

import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from rich.console import Console

from orchestrator.doctor import (
    Finding,
    as_lines,
    as_table,
    diagnose,
    has_faults,
    machine,
    packages,
    selftest,
    storage,
    surroundings,
)
from orchestrator.doctor.finding import GIB


def by_name(findings: list[Finding]) -> dict[str, Finding]:
    return {finding.name: finding for finding in findings}


def test_this_machine_has_no_fault(tmp_path: Path) -> None:
    findings = diagnose(tmp_path / "runs")
    assert [finding for finding in findings if finding.status == "fault"] == []
    assert not has_faults(findings)
    names = by_name(findings)
    assert {"Python", "torch", "numpy", "mujoco", "cores", "disk", "self test"} <= names.keys()
    assert "pytest" not in names  # extras are nobody's duty
    assert all(finding.advice for finding in findings if finding.status != "ok")
    assert list(tmp_path.iterdir()) == []


def test_a_root_that_cannot_be_written_to(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("in the way")
    (finding,) = storage.check_root(file)
    assert finding.status == "fault"
    assert str(file) in finding.found
    assert "--out" in finding.advice
    (finding,) = storage.check_root(file / "below")
    assert finding.status == "fault"


def odd_machine(tmp_path: Path, package: str, mistake: str) -> dict[str, Finding]:
    """What the doctor says where much is amiss, itself in a process of its own."""
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / f"{package}.py").write_text(mistake)
    environment = {
        "PYTHONPATH": os.pathsep.join([str(tmp_path / "broken"), os.getcwd()]),
        "HOME": "/proc/none",
        "TMPDIR": str(tmp_path / ("t" * 81)),
        "MUJOCO_GL": "nonsense",
    }
    answer = subprocess.run(
        [sys.executable, "-m", "orchestrator.cli", "doctor"],
        cwd=tmp_path,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    assert (answer.returncode, answer.stderr) == (1, "")
    assert [path.name for path in tmp_path.iterdir()] == ["broken"]  # nothing is made
    parts = [line.split(None, 1) for line in answer.stdout.splitlines()]
    return {
        name: Finding(name, status, said)  # type: ignore[arg-type]
        for status, rest in parts
        for name, _, said in [rest.partition(": ")]
    }


@pytest.mark.parametrize(
    ("package", "mistake", "said"),
    [
        ("mujoco", "raise ImportError('libGL.so.1 is missing')", "ImportError: libGL.so.1"),
        ("torch", "import ctypes; ctypes.CDLL('libtorch.so')", "OSError: libtorch.so"),
        ("torch", "import os, signal; os.kill(os.getpid(), 4)", "ends Python with SIGILL"),
    ],
)
def test_it_starts_on_odd_machines_and_says_what_to_do(
    tmp_path: Path, package: str, mistake: str, said: str
) -> None:
    found = odd_machine(tmp_path, package, mistake)
    assert found[f"importing {package}"].status == "fault"
    assert said in found[f"importing {package}"].found
    for name, advice in {
        "home": "set HOME to",
        "temporary files": "set TMPDIR or RAY_TMPDIR to",
        "MUJOCO_GL": "unset it",
    }.items():
        assert found[name].status == "warn"
        assert advice in found[name].found


@pytest.mark.parametrize(
    ("pin", "version", "status"),
    [
        ("numpy<2", "1.26.4", "ok"),
        ("numpy<2", "2.1.0", "fault"),
        ("mujoco>=3.3,<3.10", "3.9.0", "ok"),
        ("mujoco>=3.3,<3.10", "3.10.0", "fault"),
        ("mujoco>=3.3,<3.10", "3.2.7", "fault"),
        ("torch==2.13.0", "2.13.0+cpu", "ok"),
        ("torch==2.13.0", "2.12.1", "fault"),
        ("pandas", "3.0", "ok"),
        ("pandas", None, "fault"),
    ],
)
def test_packages_are_held_to_their_pins(pin: str, version: str | None, status: str) -> None:
    finding = packages.judge_package(Requirement(pin), version)
    assert finding.status == status
    assert finding.found == (version or "not installed")
    assert bool(finding.advice) == (status != "ok")


def test_advice_says_what_to_install_and_why() -> None:
    advice = packages.judge_package(Requirement("mujoco>=3.3,<3.10"), "3.17").advice
    assert 'pip install "mujoco<3.10,>=3.3"' in advice
    assert "break robosuite" in advice


def test_a_source_tree_that_was_never_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def requires(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "requires", requires)
    (finding,) = packages.check_packages()
    assert finding.status == "fault"
    assert "pip install -e '.[run]'" in finding.advice


@pytest.mark.parametrize(
    ("finding", "status"),
    [
        (packages.judge_python("3.11.9"), "ok"),
        (packages.judge_python("3.12.0"), "fault"),
        (machine.judge_cores(8, None), "ok"),
        (machine.judge_cores(8, "1"), "ok"),
        (machine.judge_cores(8, "8"), "warn"),
        (machine.judge_memory(64 * GIB), "ok"),
        (machine.judge_memory(4 * GIB), "warn"),
        (machine.judge_memory(1 * GIB), "fault"),
        (machine.judge_shared_memory(2 * GIB), "ok"),
        (machine.judge_shared_memory(64 * 2**20), "warn"),  # Docker's default
        (storage.judge_disk(100 * GIB), "ok"),
        (storage.judge_disk(5 * GIB), "warn"),
        (storage.judge_disk(GIB // 2), "fault"),
        (packages.judge_sqlite((3, 45, 1)), "ok"),
        (packages.judge_sqlite((3, 30, 9)), "fault"),
        (machine.judge_rendering(["EGL"]), "ok"),
        (machine.judge_rendering([]), "warn"),
        (surroundings.judge_import("torch", 0, ""), "ok"),
        (surroundings.judge_import("torch", 1, "OSError: libtorch.so: cannot open"), "fault"),
        (surroundings.judge_import("torch", -4, ""), "fault"),
        (surroundings.judge_home(Path("/root"), True), "ok"),
        (surroundings.judge_home(Path("/root"), False), "warn"),
        (surroundings.judge_numba(None, True), "ok"),
        (surroundings.judge_numba("/data/numba", True), "ok"),
        (surroundings.judge_numba(None, False), "fault"),
        (surroundings.judge_temporary(None), "ok"),
        (surroundings.judge_temporary("/dev/shm/skillstitch-0/ray"), "warn"),
        (surroundings.judge_drawing("egl", 0, ""), "ok"),
        (surroundings.judge_drawing("osmesa", 1, "AttributeError: glGetError"), "warn"),
        (surroundings.judge_drawing("glfw", -11, ""), "warn"),
        (selftest.judge_determinism({"w": b"1"}, {"w": b"1"}, 0.5), "ok"),
        (selftest.judge_determinism({"w": b"1"}, {"w": b"2"}, 0.5), "fault"),
    ],
)
def test_judgements(finding: Finding, status: str) -> None:
    assert finding.status == status
    assert bool(finding.advice) == (status != "ok")


def test_a_training_that_diverges_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def diverges() -> None:
        raise FloatingPointError("training diverged: value_loss is nan at update 5")

    monkeypatch.setattr(selftest, "train_tiny_agent", diverges)
    finding = selftest.check_training()
    assert finding.status == "fault"
    assert "value_loss is nan" in finding.found


def test_a_check_that_breaks_keeps_no_other_from_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks() -> Finding:
        raise OSError("libtorch is missing\nand more")

    monkeypatch.setattr(machine, "check_gpu", breaks)
    monkeypatch.setattr(selftest, "check_training", breaks)
    found = by_name(diagnose(tmp_path))
    assert found["GPU"].status == "fault"
    assert found["GPU"].found == "OSError: libtorch is missing"
    assert found["disk"].status != "fault"


def test_both_renderings_say_all() -> None:
    findings = [
        Finding("numpy", "fault", "2.1", 'run `pip install "x[dev]"`'),
        Finding("disk", "ok", "9"),
    ]
    console = Console(width=100)
    with console.capture() as capture:
        console.print(as_table(findings))
    assert '"x[dev]"' in capture.get()
    assert as_lines(findings) == [
        'fault  numpy: 2.1; run `pip install "x[dev]"`',
        "ok     disk: 9",
    ]
