"""Python and the packages: are they those that the pins ask for?"""

from __future__ import annotations

import importlib.metadata

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from orchestrator.doctor.finding import Finding

DISTRIBUTION = "skillstitch"
PYTHON = SpecifierSet(">=3.11,<3.12")
SQLITE = (3, 31)  # MLflow's schema has computed columns

REASONS = {
    "mujoco": "3.10 and later break robosuite and gymnasium-robotics",
    "numpy": "robosuite's kinematics need numpy 1",
    "torch": "another version may change the bytes of every result",
}
"""Why a pin is there, where it is not just the version that was tested."""


def judge_python(version: str) -> Finding:
    """Whether it is the Python that the packages need."""
    if version in PYTHON:
        return Finding("Python", "ok", version)
    return Finding("Python", "fault", version, f"use Python {PYTHON}: robosuite's pins need it")


def check_packages() -> list[Finding]:
    """Every requirement of the installed distribution that applies here."""
    try:
        required = importlib.metadata.requires(DISTRIBUTION) or []
    except importlib.metadata.PackageNotFoundError:
        advice = "run `pip install -e '.[run]'` in the source tree"
        return [Finding(DISTRIBUTION, "fault", "not installed", advice)]
    requirements = [Requirement(line) for line in required]
    needed = [r for r in requirements if r.marker is None or r.marker.evaluate({"extra": "run"})]
    return [judge_package(requirement, installed(requirement.name)) for requirement in needed]


def installed(package: str) -> str | None:
    """The version of a package; None where there is none."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def judge_package(requirement: Requirement, version: str | None) -> Finding:
    """Whether an installed version meets a requirement."""
    name = requirement.name
    if version is not None and requirement.specifier.contains(version, prereleases=True):
        return Finding(name, "ok", version)
    because = f": {REASONS[name]}" if name in REASONS else ""
    advice = f'run `pip install "{name}{requirement.specifier}"`{because}'
    return Finding(name, "fault", version or "not installed", advice)


def judge_sqlite(version: tuple[int, ...]) -> Finding:
    """Whether SQLite is new enough."""
    found = ".".join(map(str, version))
    if version >= SQLITE:
        return Finding("SQLite", "ok", found)
    wanted = ".".join(map(str, SQLITE))
    return Finding("SQLite", "fault", found, f"use a Python built with SQLite {wanted} or later")
