"""What a person is told while work goes on."""

import io
import re
import time

import pytest
from rich.console import Console

from orchestrator.work import progress
from orchestrator.work.progress import ConsoleProgress, UnderWay


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.02)
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LOOKS", 0.01)


def lines_of(console: Console) -> list[str]:
    file = console.file
    assert isinstance(file, io.StringIO)
    return file.getvalue().splitlines()


@pytest.mark.usefixtures("impatient")
def test_without_a_terminal_there_are_lines_while_nothing_is_finished() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: UnderWay("agent seed 0")):
            time.sleep(0.3)
    first, *others = lines_of(console)
    assert first == "training: 1 of 3 already there"
    assert len(others) > 2
    assert all(line.startswith("training: 1/3 after ") for line in others)
    assert all(line.endswith("; agent seed 0") for line in others)


@pytest.mark.usefixtures("impatient")
def test_on_a_terminal_the_bar_says_it() -> None:
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: UnderWay("agent seed 0")):
            time.sleep(0.3)
    assert "agent seed 0" in "".join(lines_of(console))
    assert "already there" not in "".join(lines_of(console))


@pytest.mark.usefixtures("impatient")
def test_a_look_that_fails_disturbs_nothing() -> None:
    def look() -> UnderWay:
        raise OSError("the folder is gone")

    console = Console(file=io.StringIO(), width=200)
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(look):
            time.sleep(0.2)
    assert len(lines_of(console)) > 2
    assert all("gone" not in line for line in lines_of(console))


@pytest.mark.usefixtures("impatient")
def test_the_bar_moves_within_a_training() -> None:
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    shares = iter([0.25, 0.5, 0.75])
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: UnderWay(share=next(shares, 0.8))):
            time.sleep(0.5)
    drawn = "".join(lines_of(console))
    assert {"25%", "80%", "1/3"} <= set(re.findall(r"\d+%|\d/\d", drawn))
    assert re.search(r"left \S*0:\d\d:\d\d", drawn)  # what that leaves, at this rate


@pytest.mark.usefixtures("impatient")
def test_lines_tell_the_share_and_the_time_left() -> None:
    console = Console(file=io.StringIO(), width=200)
    began = time.monotonic()
    with ConsoleProgress(console) as told:
        told.phase("training", 3, 1)
        with told.watching(lambda: UnderWay(share=(time.monotonic() - began) / 100)):
            time.sleep(0.3)
    last = lines_of(console)[-1]
    assert (left := re.fullmatch(r"training: 1/3 \(\d%\) after \d+ s, about (\d+) s left", last))
    assert 90 <= int(left[1]) <= 110


@pytest.mark.usefixtures("impatient")
def test_there_is_a_line_whatever_goes_on() -> None:
    """Before there is anything to count, in steps, between and after phases."""
    console = Console(file=io.StringIO(), width=200)
    with ConsoleProgress(console) as told:
        time.sleep(0.2)
        with told.step("starting workers"):
            time.sleep(0.2)
        told.phase("training", 1, 0)
        told.advance()
        time.sleep(0.2)
        with told.step("report"):
            time.sleep(0.2)
    kinds = [line.partition(":")[0] for line in lines_of(console)]
    assert list(dict.fromkeys(kinds)) == ["preparing", "starting workers", "training", "report"]
    assert all(kinds.count(kind) > 2 for kind in set(kinds))


def test_lines_are_fifteen_seconds_apart_at_most() -> None:
    assert progress.SECONDS_BETWEEN_LINES + progress.SECONDS_BETWEEN_LOOKS <= 15


@pytest.mark.usefixtures("impatient")
def test_a_step_is_on_the_terminal_while_it_lasts() -> None:
    console = Console(file=io.StringIO(), width=200, force_terminal=True)
    with ConsoleProgress(console) as told:
        with told.step("starting workers"):
            time.sleep(0.2)
        assert "starting workers" in "".join(lines_of(console))
        assert not told._bar.tasks
