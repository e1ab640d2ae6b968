"""Errors a user can cause or meet: each says what, where, what to do, and has its exit code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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
