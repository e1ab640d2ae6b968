"""One look a method, in every figure."""

from analysis.figures.style import COLOURS, MARKERS, METHODS, looks


def test_a_method_looks_the_same_beside_any_others() -> None:
    alone, together = looks(["mb-stitch"]), looks(METHODS)
    assert alone["mb-stitch"] == together["mb-stitch"]
    assert looks(["reach-stitch", "no-stitch"])["reach-stitch"] == together["reach-stitch"]
    assert looks(["mb-stitch@level-1"])["mb-stitch@level-1"] == together["mb-stitch"]
    assert len(set(together.values())) == len(METHODS)


def test_settings_of_one_method_and_others_are_told_apart() -> None:
    methods = ["no-stitch", "mb-stitch[alpha=1]", "mb-stitch[alpha=2]", "hold-stitch"]
    found = looks(methods)
    assert found["mb-stitch[alpha=1]"] == looks(METHODS)["mb-stitch"]
    assert len(set(found.values())) == len(methods)


def test_there_are_looks_for_any_number() -> None:
    many = looks([f"method-{number}" for number in range(20)])
    assert {colour for colour, _ in many.values()} == set(COLOURS)
    assert {marker for _, marker in many.values()} == set(MARKERS)
