"""What a person sees while work is under way: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from threading import Event, Thread
from types import TracebackType
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as RichBar

SECONDS_BETWEEN_LINES = 10.0
SECONDS_BETWEEN_LOOKS = 3.0  # so there is a line every 13 s, whatever goes on

WHOLE = 1_000_000  # of a bar


@dataclass(frozen=True)
class UnderWay:
    """What is known of a phase before it has ended."""

    told: str = ""  # in a few words
    share: float | None = None  # of all its work that is done, from 0 to 1; None: as many as are


Look = Callable[[], UnderWay]
"""Looks at what is under way."""


class Progress(Protocol):
    """Shows a person how far the work is."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...

    def watching(self, look: Look) -> AbstractContextManager[None]:
        """Within it a person is told what is under way of the phase, also within its pieces."""

    def step(self, name: str) -> AbstractContextManager[None]:
        """Something without pieces to count, which may take long."""


class Silent:
    """Progress for tests and benchmarks."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...

    def watching(self, look: Look) -> AbstractContextManager[None]:
        return nullcontext()

    def step(self, name: str) -> AbstractContextManager[None]:
        return nullcontext()


@dataclass
class _Phase:
    """Pieces of work that are counted."""

    name: str
    total: int
    done: int
    began: float  # on the monotonic clock, as all times here
    task: TaskID
    look: Look | None = None
    under_way: UnderWay = UnderWay()
    first_seen: tuple[float, float] = (0.0, 0.0)  # when, and the share that was done then

    @property
    def share(self) -> float:
        if self.done >= self.total:
            return 1.0
        known = self.under_way.share
        return self.done / self.total if known is None else known

    @property
    def count(self) -> str:
        return f"{self.done}/{self.total}"

    def line(self, now: float) -> str:
        """ "training: 3/12 (41%) after 60 s, about 90 s left; agent, seed 0: …" """
        known, left = "", ""
        if self.done >= self.total:
            return f"{self.name}: {self.count} after {now - self.began:.0f} s"
        if self.under_way.share is not None:
            known = f" ({self.share:.0%})"
            when, share = self.first_seen
            if self.share > share:
                seconds = (1 - self.share) * (now - when) / (self.share - share)
                left = f", about {seconds:.0f} s left"
        told = f"; {self.under_way.told}" if self.under_way.told else ""
        return f"{self.name}: {self.count}{known} after {now - self.began:.0f} s{left}{told}"


class ConsoleProgress:
    """A rich progress bar with the time left, or a line now and then where there is no terminal.

    Lines come from a thread of its own: also while workers start or a report is written.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar = RichBar(
            TextColumn("{task.description:<11}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[count]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[told]}"),
            console=console,
            disable=not console.is_terminal,
        )
        self._phase: _Phase | None = None
        self._step: tuple[str, float] | None = None  # its name, and when it began
        self._began = self._spoke = time.monotonic()
        self._ended = Event()
        self._watcher = Thread(target=self._watch, daemon=True)

    def __enter__(self) -> ConsoleProgress:
        self._bar.start()
        self._watcher.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._bar.stop()

    def phase(self, name: str, total: int, done: int) -> None:
        now = time.monotonic()
        task = self._bar.add_task(name, total=WHOLE, count="", told="")
        self._phase = phase = _Phase(name, total, done, now, task)
        self._bar.reset(task, completed=round(WHOLE * phase.share), count=phase.count, told="")
        if not self._console.is_terminal:
            self._spoke = now
            self.say(f"{name}: {done} of {total} already there")

    def advance(self, count: int = 1) -> None:
        phase = self._phase
        if phase is None:
            return
        phase.done += count
        self._draw(phase)
        self._tell(now=phase.done >= phase.total)

    @contextmanager
    def watching(self, look: Look) -> Iterator[None]:
        phase = self._phase
        if phase is None:
            yield
            return
        phase.look = look
        self._see(phase)
        phase.first_seen = time.monotonic(), phase.share
        # What was there already says nothing about how fast this goes.
        self._bar.reset(phase.task, completed=round(WHOLE * phase.share))
        try:
            yield
        finally:
            phase.look, phase.under_way = None, UnderWay()
            self._draw(phase)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        before, self._step = self._step, (name, time.monotonic())
        task = self._bar.add_task(name, total=None, count="", told="")
        try:
            yield
        finally:
            self._step = before
            self._bar.remove_task(task)

    def say(self, message: str) -> None:
        self._console.print(message, markup=False, highlight=False)

    def _watch(self) -> None:
        while not self._ended.wait(SECONDS_BETWEEN_LOOKS):
            if self._phase is not None and self._phase.look is not None:
                self._see(self._phase)
                self._draw(self._phase)
            self._tell()

    def _see(self, phase: _Phase) -> None:
        try:
            phase.under_way = phase.look() if phase.look else UnderWay()
        except Exception:  # what is told of the work must not disturb it
            phase.under_way = UnderWay()

    def _draw(self, phase: _Phase) -> None:
        told = phase.under_way.told
        self._bar.update(
            phase.task, completed=round(WHOLE * phase.share), count=phase.count, told=told
        )

    def _tell(self, *, now: bool = False) -> None:
        """A line, unless there was one just before, or a bar shows the same."""
        time_now = time.monotonic()
        due = now or time_now - self._spoke >= SECONDS_BETWEEN_LINES
        if not due or self._console.is_terminal or self._ended.is_set():
            return
        self._spoke = time_now
        if self._step is not None:
            name, began = self._step
            self.say(f"{name}: {time_now - began:.0f} s")
        elif self._phase is not None:
            self.say(self._phase.line(time_now))
        else:
            self.say(f"preparing: {time_now - self._began:.0f} s")
