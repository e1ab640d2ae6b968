"""What packages find around them: whether each can be imported, and where it can write."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from analysis.backends import CHOSEN
from orchestrator import libraries
from orchestrator.doctor.finding import Finding
from orchestrator.errors import UsageError

IMPORTED = ("torch", "mujoco", "robosuite", "ray")  # those with compiled code of their own
MOST_SECONDS = 120  # to import one


def check_imports() -> list[Finding]:
    """Import each package in a process of its own: some end it where they do not fit the CPU."""
    here = [name for name in IMPORTED if find_spec(name)]  # others are faults already
    started = {name: _python(f"import {name}") for name in here}
    findings = [judge_import(name, *_end(process)) for name, process in started.items()]
    broken = [finding for finding in findings if finding.status != "ok"]
    return broken or [Finding("imports", "ok", ", ".join(here))]


def judge_import(name: str, code: int, said: str) -> Finding:
    """By the exit code of the process, and what it has said."""
    if code == 0:
        return Finding(f"importing {name}", "ok", "works")
    if code < 0:
        found = f"ends Python with {signal.Signals(-code).name}"
        advice = "it was built for another CPU or system: install the wheel for this one"
        return Finding(f"importing {name}", "fault", found, advice)
    advice = f"run `pip install --force-reinstall --no-deps {name}`, or install what it asks for"
    return Finding(f"importing {name}", "fault", said, advice)


def check_places() -> Iterator[Finding]:
    """Home, what numba compiles, and temporary files."""
    yield judge_home(libraries.home(), libraries.could_write(libraries.home()))
    yield judge_numba(os.environ.get("NUMBA_CACHE_DIR"), libraries.numba_can_write())
    try:
        yield judge_temporary(libraries.ray_folder())
    except UsageError as error:
        yield Finding("temporary files", "fault", "no place for them", str(error))


def judge_home(folder: Path, writable: bool) -> Finding:
    """Nothing needs it, but some packages keep there what they look up again."""
    if writable:
        return Finding("home", "ok", str(folder))
    advice = "set HOME to a folder that can be written to; until then fonts are looked up again"
    return Finding("home", "warn", f"{folder} cannot be written to", advice)


def judge_numba(named: str | None, writable: bool) -> Finding:
    """Robosuite's compiled functions: its own folder, one below home, or one that is named."""
    advice = "set NUMBA_CACHE_DIR to a folder that can be written to"
    if not writable:
        found = "neither the installed packages nor the home can be written to"
        return Finding("compiled code", "fault", found, f"{advice}: robosuite needs one")
    if named and libraries.is_temporary(Path(named)):
        return Finding("compiled code", "warn", f"goes to {named}", f"{advice} and stays")
    return Finding("compiled code", "ok", f"goes to {named}" if named else "can be kept")


def judge_temporary(instead: str | None) -> Finding:
    """Where Ray's sockets go, if not where it would put them."""
    if instead is None:
        return Finding("temporary files", "ok", "can be written")
    found = f"Ray's go to {instead}: TMPDIR cannot be written to, or its name is too long"
    most = libraries.LONGEST - len("/ray")
    advice = f"set TMPDIR or RAY_TMPDIR to a folder with at most {most} characters in its name"
    return Finding("temporary files", "warn", found, advice)


def check_drawing() -> Iterator[Finding]:
    """The user's MUJOCO_GL, if there is one."""
    if chosen := os.environ.get(CHOSEN):
        code, said = _end(_python("import mujoco; mujoco.GLContext(8, 8)", MUJOCO_GL=chosen))
        yield judge_drawing(chosen, code, said)


def judge_drawing(chosen: str, code: int, said: str) -> Finding:
    """Whether MuJoCo draws as it is told to."""
    if code == 0:
        return Finding("MUJOCO_GL", "ok", chosen)
    advice = "only pictures of episodes need it: unset it, or install what that library is part of"
    return Finding("MUJOCO_GL", "warn", f"{chosen}: {said or 'ends Python'}", advice)


def _python(code: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def _end(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and last line of a process."""
    try:
        _, said = process.communicate(timeout=MOST_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return 1, f"took more than {MOST_SECONDS} s"
    lines = said.strip().splitlines()
    return process.returncode, lines[-1] if lines else ""
