"""From a spec to a finished ledger, and from there to tables and a report.

    from orchestrator import load_spec, plan, reproduce
    directory = reproduce(load_spec("table1", scale="smoke"))

Torch and the simulators are imported with the first call: that takes seconds.
"""

from __future__ import annotations

from importlib.metadata import version
from os import PathLike
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from pathlib import Path

    from orchestrator.spec.spec import Spec
    from orchestrator.spec.suite import Suite
    from orchestrator.spec.tomls import Scale
    from orchestrator.work.plan import Plan

__all__ = ["load_spec", "load_suite", "plan", "reproduce"]
__version__ = version("skillstitch")


def load_spec(name_or_file: str | PathLike[str], scale: Scale = "paper") -> Spec:
    """A packaged spec by name, or any TOML file, at one of its scales.

    A frozen dataclass: `dataclasses.replace` changes a field, and what could not be carried out is
    refused. Raises UsageError for an unknown name, field, scale or value, listing what is valid.
    """
    from orchestrator.spec.spec import load_spec

    return load_spec(str(name_or_file), scale)


def load_suite(name_or_file: str | PathLike[str], scale: Scale = "paper") -> Suite:
    """Likewise a suite: several specs and the tables over them. UsageError where it is none."""
    from orchestrator.errors import UsageError
    from orchestrator.spec.suite import Suite, load_asked

    asked = load_asked(str(name_or_file), scale)
    if not isinstance(asked, Suite):
        raise UsageError(f"{name_or_file} is no suite: it has no parts; use load_spec")
    return asked


def plan(spec: Spec) -> Plan:
    """What a spec takes: recipes of artifacts, and blocks of episodes. Runs nothing."""
    from orchestrator.work.plan import make_plan

    return make_plan(spec)


def reproduce(
    spec: Spec | Suite,
    out: str | PathLike[str] | None = None,
    *,
    store: str | PathLike[str] | None = None,
    executor: Literal["ray", "serial"] = "ray",
    workers: int | None = None,
    address: str | None = None,
    tracking_uri: str | None = None,
) -> Path:
    """Carry a spec or a suite out, or go on where it ended; returns the run directory.

    Does what `skillstitch run` does, with its defaults; `analysis.open_run` reads the result.
    Raises SkillstitchError (`orchestrator.errors`), whose kinds say what is wrong.
    """
    from pathlib import Path

    from orchestrator.libraries import give_places, set_drawing_aside
    from orchestrator.reproduction import Settings
    from orchestrator.storage.rundir import default_out
    from orchestrator.storage.store import USUAL_STORE
    from orchestrator.suite_reproduction import reproduce_asked
    from orchestrator.work.progress import Silent

    give_places()
    set_drawing_aside()
    settings = Settings(
        Path(out) if out is not None else default_out(spec),
        Path(store) if store is not None else USUAL_STORE,
        executor,
        workers,
        address,
        tracking_uri,
    )
    return reproduce_asked(spec, settings, Silent()).path
