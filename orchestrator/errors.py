"""Errors a user can cause or meet: each says what, where, what to do, and has its exit code."""

from __future__ import annotations

import errno
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from stitching.registry import PartError

RUN_PACKAGES = ("torch", "mujoco", "ray", "optuna", "mlflow", "gymnasium_robotics", "robosuite")
OUT_OF_REACH = (errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG)  # of paths given


class SkillstitchError(Exception):
    """Base of everything the command line turns into one clear line and an exit code."""

    exit_code = 1


class UsageError(SkillstitchError):
    """The request itself is wrong: an unknown table, field, method or file."""

    exit_code = 2


class IncompleteError(SkillstitchError):
    """The run ended early but nothing is lost: the same command resumes it."""

    exit_code = 3


class StorageError(IncompleteError):
    """The disk is full or refuses to be written to; free some space and resume."""


class LockedError(SkillstitchError):
    """Another process holds the run directory."""

    exit_code = 4


class ChangedError(SkillstitchError):
    """The run directory was made under another spec, package set, code version or artifact."""

    exit_code = 5


class NondeterminismError(SkillstitchError):
    """The same work gave different bytes: no number of this run can be trusted."""

    exit_code = 6


class BadDataError(SkillstitchError):
    """A dataset or a training run is unusable: wrong shapes, values that are not finite."""

    exit_code = 7


@contextmanager
def said_to_users() -> Iterator[None]:
    """The analysis refuses with ValueErrors of its own, written for users."""
    from analysis.schema import RunError

    try:
        yield
    except RunError as error:
        raise UsageError(str(error)) from error


def explained(error: Exception) -> tuple[str, int] | None:
    """What the command line says of an error, and how it exits; None for a mistake of ours."""
    if isinstance(error, SkillstitchError):
        return str(error), error.exit_code
    if isinstance(error, PartError):
        return f"{error}; mend or uninstall it", UsageError.exit_code
    if isinstance(error, ModuleNotFoundError) and error.name in RUN_PACKAGES:
        return (
            f"{error.name} is not installed, and this command trains, plays or plans: install "
            "skillstitch with its extra `run`, as in `pip install -e '.[run]'`",
            UsageError.exit_code,
        )
    if package := failed_import(error):
        said = " ".join(traceback.format_exception_only(error)[-1].split())
        return (
            f"{package} cannot be imported ({said}): `skillstitch doctor` says what to do",
            UsageError.exit_code,
        )
    if isinstance(error, OSError) and error.filename and error.errno in OUT_OF_REACH:
        return f"{error.filename}: {error.strerror}; name another", UsageError.exit_code
    return None


def failed_import(error: Exception) -> str | None:
    """Which package raised this while it was imported; Python forgets one that did."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        package = str(frame.f_globals.get("__name__")).partition(".")[0]
        if package in RUN_PACKAGES and package not in sys.modules:
            return package
    return None
