"""SIGTERM: an interrupt of its own exit code, and whoever else sets a handler gives it back."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from orchestrator.cli import TERMINATED
from orchestrator.interruption import interrupted_by_sigterm, own_handler_kept


@pytest.fixture(autouse=True)
def handler() -> Iterator[object]:
    before = signal.getsignal(signal.SIGTERM)
    yield before
    assert signal.getsignal(signal.SIGTERM) is before
    signal.signal(signal.SIGTERM, before)


def test_sigterm_interrupts_and_is_told_from_ctrl_c() -> None:
    with pytest.raises(KeyboardInterrupt), interrupted_by_sigterm() as sigterm:
        signal.raise_signal(signal.SIGTERM)
    assert sigterm.received
    with pytest.raises(KeyboardInterrupt), interrupted_by_sigterm() as sigterm:
        raise KeyboardInterrupt  # as SIGINT does, unless it is ignored, as in the background
    assert not sigterm.received


def test_a_handler_that_is_set_inside_is_gone_afterwards() -> None:
    with interrupted_by_sigterm() as sigterm:
        with own_handler_kept():
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert sigterm.received


def test_an_exit_by_another_handler_is_passed_on() -> None:
    def starts_and_meets_a_signal() -> None:
        with own_handler_kept():
            signal.signal(signal.SIGTERM, lambda *_: sys.exit(15))
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(KeyboardInterrupt), interrupted_by_sigterm() as sigterm:
        starts_and_meets_a_signal()
    assert sigterm.received


def test_elsewhere_than_in_the_main_thread_nothing_is_set() -> None:
    before, seen = signal.getsignal(signal.SIGTERM), []

    def inside() -> None:
        with interrupted_by_sigterm(), own_handler_kept():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    assert seen == [before]


def test_a_command_that_is_ended_says_so_and_exits_with_143() -> None:
    code = (
        "import os, signal\n"
        "from orchestrator import cli\n"
        "cli.COMMANDS['wait'] = (lambda *_: os.kill(os.getpid(), signal.SIGTERM), '')\n"
        "cli.main(['wait'])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=dict(os.environ)
    )
    assert ended.returncode == TERMINATED
    assert ended.stderr == "interrupted; the same command resumes\n"
