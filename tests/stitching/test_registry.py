"""Parts of other packages: found by their entry points, refused with the package's name."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from stitching.bounds import Bounded, Count
from stitching.planning.registry import PlannerChoice
from stitching.registry import PartError, field_name, sections, with_installed, wrong_settings

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


def no_number(part: object) -> str:
    return "" if isinstance(part, int) else "is no number"


def test_parts_of_other_packages_follow_our_own(folder: Path) -> None:
    assert with_installed(GROUP, OWN, no_number) == OWN
    installed(folder, "two = some_parts:two", "also-two = some_parts:two")
    found = with_installed(GROUP, OWN, no_number)
    assert list(found.items()) == [("one", 1), ("also-two", 2), ("two", 2)]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("two = some_parts:three", "AttributeError"),
        ("two = no_such_module:two", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("two = some_parts:word", r"some_parts:word is no number \(see docs/extending.md\)"),
        ("one = some_parts:two", "this name is taken"),
        ("class = some_parts:two", "no keywords of Python"),
        ("Two Parts = some_parts:two", "names have small letters, digits and '-'"),
    ],
)
def test_what_cannot_be_a_part_is_refused(folder: Path, line: str, message: str) -> None:
    installed(folder, line)
    with pytest.raises(PartError, match=f"some-parts, entry point .*{message}"):
        with_installed(GROUP, OWN, no_number)


def test_a_section_has_the_settings_of_every_part() -> None:
    made = sections("Made", {"mb-stitch": int, "cem": float})
    assert field_name("mb-stitch") == "mb_stitch"
    assert vars(made(mb_stitch=3)) == {"mb_stitch": 3, "cem": 0.0}


@dataclass(frozen=True)
class Complete(Bounded):
    size: int = 1


@dataclass(frozen=True)
class Incomplete(Bounded):
    size: int


@dataclass(frozen=True)
class Wrong(Bounded):
    size: Count = -1


@dataclass
class Loose(Bounded):
    size: int = 1


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        (Complete, ""),
        (Complete(), "is no dataclass"),
        (int, "is no dataclass"),
        (Incomplete, "has no default for 'size'"),
        (Wrong, "has a default that does not fit: size: must be at least 1: -1"),
        (Loose, "is not frozen: write @dataclass(frozen=True)"),
    ],
)
def test_settings_are_a_dataclass_with_defaults(settings: object, problem: str) -> None:
    assert wrong_settings(settings, Bounded) == problem


def test_settings_check_their_ranges() -> None:
    assert wrong_settings(Complete, PlannerChoice) == "does not inherit from PlannerChoice"


def test_a_setting_called_like_a_planner_is_refused() -> None:
    with pytest.raises(PartError, match="planner 'cem': Plans has another setting so called"):

        class Plans(PlannerChoice):
            cem: int = 3
