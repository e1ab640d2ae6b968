"""Processes by their parents, as /proc has them: to find Ray's, and to end them."""

from pathlib import Path


def descendants(root: int) -> list[int]:
    """All processes below one, nearest first."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            after_name = (folder / "stat").read_text().rpartition(")")[2]
        except OSError:  # it has just ended
            continue
        children.setdefault(int(after_name.split()[1]), []).append(int(folder.name))
    found, waiting = [], [root]
    while waiting:
        below = children.get(waiting.pop(0), [])
        found += below
        waiting += below
    return found


def title(process: int) -> str:
    """Its command line, which Ray's workers replace by what they are doing."""
    try:
        words = (Path("/proc") / str(process) / "cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return " ".join(word.decode(errors="replace") for word in words).strip()


def titled(root: int, part: str) -> list[int]:
    """Descendants whose title contains a text."""
    return [process for process in descendants(root) if part in title(process)]
