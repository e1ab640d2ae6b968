"""Which learning curves a method is shown with."""

from orchestrator.tracking.metrics import learning_curves


def test_a_method_is_shown_with_what_it_is_played_with() -> None:
    training = [
        {"kind": kind, "seed": 0, "key": "k", "curves": {"value_loss": [[1, 0.5]]}}
        for kind in ("agent", "dynamics", "single-policy")
    ]
    for kinds in (("single-policy",), ("agent", "dynamics")):
        curves = learning_curves("any", kinds, 0, training)
        assert list(curves) == [f"{kind}/value_loss" for kind in kinds]
