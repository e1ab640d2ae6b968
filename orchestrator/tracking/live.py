"""MLflow's view while the work goes on, kept up to date from a thread beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Event, Thread
from types import TracebackType
from typing import Any

SECONDS_BETWEEN = 30.0  # of publications of work under way
SECONDS_TO_END = 5.0  # wait for one that is under way when the work breaks off


@dataclass
class Growing:
    """Learning curves while they grow, and what this process has published of them."""

    read: Callable[[], list[dict[str, Any]]]  # entries as `training.json` has them
    published: list[dict[str, Any]] | None = None  # the last ones
    points: dict[tuple[str, str], int] = field(default_factory=dict)  # MLflow run, metric → sent


class Live:
    """Publishes at once and then every so often, until the work within it ends.

    A thread of its own, because importing MLflow alone takes seconds. Its outcome does not matter:
    what is missed now, the last publication brings.
    """

    def __init__(self, publish: Callable[[Event], object], seconds: float | None = None) -> None:
        """publish: raises nothing, and breaks off soon after the event that it is given is set."""
        self._publish, self._seconds = publish, seconds or SECONDS_BETWEEN
        self._ending = Event()
        self._thread = Thread(target=self._go_on, daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ending.set()
        self._thread.join(None if kind is None else SECONDS_TO_END)

    def _go_on(self) -> None:
        self._publish(self._ending)
        while not self._ending.wait(self._seconds):
            self._publish(self._ending)
