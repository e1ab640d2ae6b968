"""The file of a sweep's study, as lines: mended after a kill, and read without Optuna."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from orchestrator.errors import StorageError
from orchestrator.spec.structure import Plain
from orchestrator.storage.store import make_folder, storage_errors

JOURNAL = "study.journal"


def repair(path: Path) -> int:
    """Cut a torn last line, which a kill can leave, from a journal; returns the bytes cut.

    Optuna appends behind it otherwise, and nothing can be read any more. Raises StorageError for
    damage elsewhere, and for a file that cannot be written.
    """
    make_folder(path.parent)
    with storage_errors(path):
        with path.open("ab"):  # refused here, before anything is played for nothing
            pass
        data = path.read_bytes()
        whole = _whole(data)
        for number, line in enumerate(whole.splitlines(), start=1):
            _entry(path, number, line)
        if len(whole) < len(data):
            with path.open("r+b") as file:
                file.truncate(len(whole))
    return len(data) - len(whole)


def entries(path: Path) -> Iterator[Plain]:
    """What is written in a journal, without a torn last line; nothing where there is no journal.

    Raises StorageError for damage elsewhere, and for a file that cannot be read.
    """
    try:
        data = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}; name another") from error
    for number, line in enumerate(_whole(data).splitlines(), start=1):
        yield _entry(path, number, line)


def _whole(data: bytes) -> bytes:
    """Up to the end of the last whole line."""
    return data[: data.rfind(b"\n") + 1]


def _entry(path: Path, number: int, line: bytes) -> Plain:
    try:
        entry: Plain = json.loads(line)
        if not (isinstance(entry, dict) and "op_code" in entry):
            raise ValueError("it has no op_code")
    except ValueError as error:
        raise StorageError(
            f"{path}, line {number}: damaged ({error}); restore the file, or move it away: the "
            "same command then asks the same trials again and finds the blocks they have played"
        ) from error
    return entry
