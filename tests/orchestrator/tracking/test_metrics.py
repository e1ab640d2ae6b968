"""Which learning curves a method is shown with."""

from orchestrator.methods import METHODS
from orchestrator.tracking.metrics import ARTIFACTS, learning_curves


def test_methods_are_shown_with_what_they_are_played_with() -> None:
    played_with = {name: set(method.artifacts) for name, method in METHODS.items()}
    assert played_with == {name: ARTIFACTS.get(name, {"agent"}) for name in METHODS}


def test_a_policy_of_its_own_stands_alone() -> None:
    training = [
        {"kind": kind, "seed": 0, "key": "k", "curves": {"value_loss": [[1, 0.5]]}}
        for kind in ("agent", "dynamics", "single-policy")
    ]
    assert list(learning_curves("single-policy", 0, training)) == ["single-policy/value_loss"]
