"""A journal is read without Optuna, torn or not."""

from pathlib import Path

import pytest

from orchestrator.errors import StorageError
from sweeps.journal import JOURNAL, entries


def test_a_torn_last_line_is_left_out_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    assert list(entries(path)) == []
    content = b'{"op_code":0}\n{"op_code":4}\n{"op_c'
    path.write_bytes(content)
    assert [entry["op_code"] for entry in entries(path)] == [0, 4]
    assert path.read_bytes() == content


def test_damage_in_the_middle_is_named(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    path.write_bytes(b'{"op_code":0}\n\0\0\0\0\n{"op_code":3}\n')
    with pytest.raises(StorageError, match=r"study\.journal, line 2: damaged"):
        list(entries(path))


@pytest.mark.parametrize("line", ["[0]", "{}", '"op_code"'])
def test_a_line_that_is_no_entry_is_named(tmp_path: Path, line: str) -> None:
    path = tmp_path / JOURNAL
    path.write_text(f'{{"op_code":0}}\n{line}\n')
    with pytest.raises(StorageError, match=r"study\.journal, line 2: damaged \(it has no op_code"):
        list(entries(path))


def test_a_journal_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    path.mkdir()
    with pytest.raises(StorageError, match=f"cannot read {path}: Is a directory"):
        list(entries(path))
