"""Streams of randomness: named by their labels alone, the same in every process and release."""

import os
import subprocess
import sys
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from stitching.streams import Label, stream

labels = st.lists(st.one_of(st.text("a1:>", max_size=4), st.integers(-5, 20)), max_size=5).map(
    tuple
)


def draws(*names: Label) -> bytes:
    return stream(*names).bytes(32)


@given(labels)
def test_the_same_labels_give_the_same_draws(names: tuple[Label, ...]) -> None:
    assert draws(*names) == draws(*names)


@given(labels, labels)
def test_other_labels_give_other_draws(names: tuple[Label, ...], others: tuple[Label, ...]) -> None:
    assert (draws(*names) == draws(*others)) == (names == others)


LOOKALIKES: list[tuple[Label, ...]] = [
    (),
    ("",),
    ("", ""),
    ("abc",),
    ("ab", "c"),
    ("a", "bc"),
    ("c", "ab"),
    (1, 2),
    ("1", "2"),
    (12,),
    ("12",),
    ("int:12",),
    ("str:12",),
]


@pytest.mark.parametrize(("first", "second"), combinations(LOOKALIKES, 2))
def test_lookalikes_are_told_apart(first: tuple[Label, ...], second: tuple[Label, ...]) -> None:
    assert draws(*first) != draws(*second)


def test_numbers_from_arrays_name_the_stream_of_the_number() -> None:
    for episode in np.arange(3):
        assert draws("policy", episode) == draws("policy", int(episode))


def test_a_stream_does_not_disturb_another() -> None:
    alone = stream("a").random(4)
    a, b = stream("a"), stream("b")
    interleaved = []
    for _ in range(4):
        interleaved.append(a.random())
        b.random(7)
    assert interleaved == alone.tolist()


def test_draws_are_those_of_the_first_release() -> None:
    """Ledgers and stores outlive a process: a change here would make them all wrong."""
    generator = stream("environment", 0, "maze", 1, 17, "g0>g2")
    assert generator.bytes(8).hex() == "438fad378f188b9a"


def test_hash_randomisation_does_not_matter() -> None:
    code = "from stitching.streams import stream; print(stream('a', 1).bytes(32).hex())"
    for seed in ("1", "2"):
        run = subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        )
        assert run.stdout.strip() == draws("a", 1).hex()


def test_neighbouring_streams_look_independent() -> None:
    """The first draws of a thousand episodes are as uniform as those of one generator."""
    first, second = np.array([stream("policy", episode).random(2) for episode in range(1000)]).T
    assert kstest(first, "uniform").pvalue > 0.01
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.1
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 0.1
