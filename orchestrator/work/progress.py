"""What a person sees while work is under way: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as RichBar

SECONDS_BETWEEN_LINES = 10.0


class Progress(Protocol):
    """Is told how far the work is; draws it for a person."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...


class Silent:
    """Progress for tests and benchmarks."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...


class ConsoleProgress:
    """A rich progress bar with the time left, or a line now and then where there is no terminal."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar = RichBar(
            TextColumn("{task.description:<11}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._task: TaskID | None = None
        self._name, self._total, self._done = "", 0, 0
        self._started = self._spoke = 0.0

    def __enter__(self) -> ConsoleProgress:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def phase(self, name: str, total: int, done: int) -> None:
        self._name, self._total, self._done = name, total, done
        self._started = self._spoke = time.monotonic()
        self._task = self._bar.add_task(name, total=total, completed=done)
        if not self._console.is_terminal:
            self.say(f"{name}: {done} of {total} already there")

    def advance(self, count: int = 1) -> None:
        self._done += count
        if self._task is not None:
            self._bar.advance(self._task, count)
        now = time.monotonic()
        last = self._done >= self._total
        if not self._console.is_terminal and (last or now - self._spoke > SECONDS_BETWEEN_LINES):
            self._spoke = now
            self.say(f"{self._name}: {self._done}/{self._total} after {now - self._started:.0f} s")

    def say(self, message: str) -> None:
        self._console.print(message, markup=False, highlight=False)
