"""Parts of other packages: found by their entry points, refused with the package's name."""

from pathlib import Path

import pytest

from stitching.registry import PartError, field_name, sections, with_installed

GROUP = "skillstitch.test-parts"
OWN = {"one": 1}


def installed(folder: Path, *lines: str) -> None:
    """A package that offers parts, as pip leaves it."""
    info = folder / "some_parts-2.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-parts\nVersion: 2.1\n")
    (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *lines]))
    (folder / "some_parts.py").write_text("two, word = 2, 'two'\n")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def is_number(part: object) -> bool:
    return isinstance(part, int)


def test_parts_of_other_packages_follow_our_own(folder: Path) -> None:
    assert with_installed(GROUP, OWN, is_number) == OWN
    installed(folder, "two = some_parts:two", "also-two = some_parts:two")
    found = with_installed(GROUP, OWN, is_number)
    assert list(found.items()) == [("one", 1), ("also-two", 2), ("two", 2)]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("two = some_parts:three", "AttributeError"),
        ("two = no_such_module:two", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("two = some_parts:word", "some_parts:word is not what skillstitch.test-parts are"),
        ("one = some_parts:two", "this name is taken"),
        ("Two Parts = some_parts:two", "names have small letters, digits and '-'"),
    ],
)
def test_what_cannot_be_a_part_is_refused(folder: Path, line: str, message: str) -> None:
    installed(folder, line)
    with pytest.raises(PartError, match=f"some-parts, entry point .*{message}"):
        with_installed(GROUP, OWN, is_number)


def test_a_section_has_the_settings_of_every_part() -> None:
    made = sections("Made", {"mb-stitch": int, "cem": float})
    assert field_name("mb-stitch") == "mb_stitch"
    assert vars(made(mb_stitch=3)) == {"mb_stitch": 3, "cem": 0.0}
