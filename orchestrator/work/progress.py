"""What a person sees while work is under way: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from threading import Event, Thread
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
SECONDS_BETWEEN_LOOKS = 3.0

Look = Callable[[], str]
"""Says in a few words what is under way; "" where nothing is known."""


class Progress(Protocol):
    """Is told how far the work is; draws it for a person."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...

    def watching(self, look: Look) -> AbstractContextManager[None]:
        """Within it a person is told what is under way, also while nothing is finished."""


class Silent:
    """Progress for tests and benchmarks."""

    def phase(self, name: str, total: int, done: int) -> None: ...

    def advance(self, count: int = 1) -> None: ...

    def say(self, message: str) -> None: ...

    def watching(self, look: Look) -> AbstractContextManager[None]:
        return nullcontext()


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
            TextColumn("{task.fields[under_way]}"),
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
        self._task = self._bar.add_task(name, total=total, completed=done, under_way="")
        if not self._console.is_terminal:
            self.say(f"{name}: {done} of {total} already there")

    def advance(self, count: int = 1) -> None:
        self._done += count
        if self._task is not None:
            self._bar.advance(self._task, count)
        self._tell(now=self._done >= self._total)

    def _tell(self, under_way: str = "", *, now: bool = False) -> None:
        """A line, unless there was one just before, or a bar shows the same."""
        time_now = time.monotonic()
        due = now or time_now - self._spoke > SECONDS_BETWEEN_LINES
        if due and not self._console.is_terminal:
            self._spoke = time_now
            line = (
                f"{self._name}: {self._done}/{self._total} after {time_now - self._started:.0f} s"
            )
            self.say(f"{line}; {under_way}" if under_way else line)

    @contextmanager
    def watching(self, look: Look) -> Iterator[None]:
        ended = Event()

        def watch() -> None:
            while not ended.wait(SECONDS_BETWEEN_LOOKS):
                try:
                    under_way = look()
                except Exception:  # what is told of the work must not disturb it
                    under_way = ""
                if self._task is not None:
                    self._bar.update(self._task, under_way=under_way)
                self._tell(under_way)

        watcher = Thread(target=watch, daemon=True)
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            if self._task is not None:
                self._bar.update(self._task, under_way="")

    def say(self, message: str) -> None:
        self._console.print(message, markup=False, highlight=False)
