"""What a bench finds: a ratio of two measurements of the same run, and the numbers behind it."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from textwrap import fill
from time import process_time

HEADER = f"{'bench':<12}{'measured':<66}{'ratio':>8}{'target':>9}{'met':>6}"


@dataclass(frozen=True)
class Result:
    bench: str
    measured: str
    numbers: dict[str, float]  # by what they are, units included
    ratio: float
    at_least: float | None = None
    at_most: float | None = None

    @property
    def target(self) -> str:
        if self.at_least is not None:
            return f"≥ {self.at_least:g}"
        return "–" if self.at_most is None else f"≤ {self.at_most:g}"

    @property
    def met(self) -> str:
        if self.at_least is None and self.at_most is None:
            return "–"
        above = self.at_least is None or self.ratio >= self.at_least
        below = self.at_most is None or self.ratio <= self.at_most
        return "yes" if above and below else "no"

    def lines(self) -> str:
        """A row under HEADER, and below it the numbers."""
        numbers = " · ".join(f"{name} {_readable(value)}" for name, value in self.numbers.items())
        indent = " " * 12
        below = fill(numbers, len(HEADER), initial_indent=indent, subsequent_indent=indent)
        row = f"{self.bench:<12}{self.measured:<66}{self.ratio:>8.2f}{self.target:>9}{self.met:>6}"
        return f"{row}\n{below}"


def _readable(number: float) -> str:
    return f"{number:,.0f}" if abs(number) >= 100 else f"{number:.3g}"


def alternate(repetitions: int, *variants: Callable[[], object]) -> list[float]:
    """Median seconds of CPU of each variant, on one thread.

    They take turns, so that a busy spell of the machine meets them all.
    """
    seconds: list[list[float]] = [[] for _ in variants]
    for _ in range(repetitions):
        for variant, spent in zip(variants, seconds, strict=True):
            began = process_time()
            variant()
            spent.append(process_time() - began)
    return [statistics.median(spent) for spent in seconds]
