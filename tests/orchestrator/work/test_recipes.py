"""Names by content: they change with all that matters and with nothing else."""

import importlib
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from orchestrator.work import recipes
from orchestrator.work.recipes import Recipe, canonical, code_fingerprint, digest, digests


def clear() -> None:
    importlib.invalidate_caches()
    code_fingerprint.cache_clear()
    recipes._code.cache_clear()
    recipes._file_of.cache_clear()


Write = Callable[[str, str], None]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Writes a module of a package that stands in for `stitching`."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(recipes, "OUR_PACKAGE", "method_under_test")

    def write(name: str, source: str) -> None:
        folder = tmp_path / "method_under_test"
        folder.mkdir(exist_ok=True)
        (folder / "__init__.py").touch()
        (folder / f"{name}.py").write_text(textwrap.dedent(source))
        clear()

    yield write
    for name in [name for name in sys.modules if name.startswith("method_under_test")]:
        del sys.modules[name]
    clear()


def fingerprint() -> str:
    return code_fingerprint(("method_under_test.top",))


def test_comments_docstrings_and_layout_do_not_matter(write: Write) -> None:
    write("top", "def f(x):\n    return x + 1\n")
    before = fingerprint()
    write(
        "top", '"""A module."""\n# why\n\ndef f(x):\n    """Adds."""\n    return (x +\n      1)\n'
    )
    assert fingerprint() == before


def test_code_matters(write: Write) -> None:
    write("top", "def f(x):\n    return x + 1\n")
    before = fingerprint()
    write("top", "def f(x):\n    return x + 2\n")
    assert fingerprint() != before


@pytest.mark.parametrize(
    "statement",
    [
        "from method_under_test.below import g",
        "from method_under_test import below",
        "import method_under_test.below",
        "def f():\n    from method_under_test.below import g",
    ],
)
def test_imported_code_matters_and_other_code_does_not(write: Write, statement: str) -> None:
    write("below", "def g(x):\n    return x\n")
    write("aside", "def h(x):\n    return x\n")
    write("top", statement + "\n")
    before = fingerprint()
    write("aside", "def h(x):\n    return -x\n")
    assert fingerprint() == before
    write("below", "def g(x):\n    return -x\n")
    assert fingerprint() != before


@pytest.fixture
def other(tmp_path: Path, write: Write) -> Write:
    """Writes a module of a package that is not ours."""

    def other(name: str, source: str) -> None:
        folder = tmp_path / "elsewhere"
        folder.mkdir(exist_ok=True)
        (folder / f"{name}.py").write_text(textwrap.dedent(source))
        clear()

    write("below", "def g(x):\n    return x\n")
    other("__init__", "from .part import HOLD\n")
    other("part", "from . import helper\nfrom method_under_test.below import g\nHOLD = 1\n")
    other("helper", "def f(x):\n    return x\n")
    return other


@pytest.mark.parametrize("name", ["__init__", "part", "helper", "new"])
def test_of_another_package_everything_counts(other: Write, name: str) -> None:
    before = code_fingerprint(("elsewhere.part",))
    other("helper", "# why\ndef f(x):\n    return x\n")
    assert code_fingerprint(("elsewhere.part",)) == before
    other(name, "X = 2\n")
    assert code_fingerprint(("elsewhere.part",)) != before


def test_what_another_package_needs_of_ours_counts(other: Write, write: Write) -> None:
    before = code_fingerprint(("elsewhere.part",))
    write("aside", "def h(x):\n    return x\n")
    assert code_fingerprint(("elsewhere.part",)) == before
    write("below", "def g(x):\n    return -x\n")
    assert code_fingerprint(("elsewhere.part",)) != before


def test_a_key_names_all_that_made_an_artifact() -> None:
    recipe = Recipe("agent", {"seed": 0, "config": {"width": 64}}, {"demonstrations": "abc"})
    others = [
        Recipe("dynamics", recipe.params, recipe.inputs),
        Recipe("agent", {"seed": 1, "config": {"width": 64}}, recipe.inputs),
        Recipe("agent", {"seed": 0, "config": {"width": 65}}, recipe.inputs),
        Recipe("agent", recipe.params, {"demonstrations": "abd"}),
    ]
    assert len({recipe.key, *(other.key for other in others)}) == 5
    reordered = Recipe("agent", {"config": {"width": 64}, "seed": 0}, recipe.inputs)
    assert reordered.key == recipe.key


def test_digests_are_stable_across_processes() -> None:
    plain = {"b": [1, 2.5, "x"], "a": None}
    assert canonical(plain) == '{"a":null,"b":[1,2.5,"x"]}'
    assert digest(plain) == "cacedc786abc936ff5388c20aad7a580"
    with pytest.raises(ValueError, match="not JSON compliant"):
        digest({"x": float("nan")})


def test_digests_that_differ_in_one_field_are_the_same_as_one_by_one() -> None:
    plain = {"a": {"episodes": [0, 1]}, "name": "Σ", "prefix": ["x", "y"], "z": 0.1}
    values = [[0, 100], [100, 150], "text", None]
    for field in ("episodes", "z", "0"):
        expected = [digest(plain | {field: value}) for value in values]
        assert list(digests(plain, field, map(canonical, values))) == expected
