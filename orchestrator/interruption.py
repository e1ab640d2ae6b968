"""SIGTERM, as batch systems, containers and spot machines send it, ends a run as Ctrl-C does."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import NoReturn


@dataclass
class Sigterm:
    """Whether it was a SIGTERM that interrupted.

    An exception of its own could not tell: Ray raises KeyboardInterrupt for any that a handler
    raises while it waits.
    """

    received: bool = False

    def interrupt(self, signum: int, frame: FrameType | None) -> NoReturn:
        self.received = True
        raise KeyboardInterrupt


@contextmanager
def interrupted_by_sigterm() -> Iterator[Sigterm]:
    """SIGTERM raises KeyboardInterrupt, as Python has it for SIGINT."""
    sigterm = Sigterm()
    with _restored():
        if _in_main_thread():
            signal.signal(signal.SIGTERM, sigterm.interrupt)
        yield sigterm


@contextmanager
def own_handler_kept() -> Iterator[None]:
    """For ray.init, which sets handlers of its own: afterwards SIGTERM's is the one from before.

    Ray's end the process by SystemExit. Where one of them does so in here, the signal is passed on
    to the handler from before.
    """
    try:
        with _restored():
            yield
    except SystemExit:
        signal.raise_signal(signal.SIGTERM)
        raise


@contextmanager
def _restored() -> Iterator[None]:
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if _in_main_thread():
            signal.signal(signal.SIGTERM, before)


def _in_main_thread() -> bool:
    """Elsewhere Python sets no handlers, and nor does Ray."""
    return threading.current_thread() is threading.main_thread()
