"""Wall-clock seconds by phase, so that a report can say where the time went."""

from __future__ import annotations

import time


class Stopwatch:
    """Every second since its making belongs to exactly one phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Everything since the last lap was this phase."""
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._last
        self._last = now

    def rounded(self) -> dict[str, float]:
        """Seconds by phase so far, to a tenth."""
        return {phase: round(seconds, 1) for phase, seconds in self.seconds.items()}
