"""What the orchestrator's tests share: a tiny reproduction, and its promised bytes."""

from collections.abc import Callable
from pathlib import Path

from orchestrator.driver import Silent
from orchestrator.reproduce import Settings, reproduce
from orchestrator.rundir import RunDirectory
from orchestrator.spec import Spec, load_spec

TINY = Path(__file__).with_name("tiny.toml")

Reproduce = Callable[..., RunDirectory]


def tiny_spec() -> Spec:
    return load_spec(str(TINY))


class Lines(Silent):
    """Keeps what a person would have been told."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.phases: dict[str, tuple[int, int]] = {}

    def phase(self, name: str, total: int, done: int) -> None:
        self.phases[name] = total, done

    def say(self, message: str) -> None:
        self.lines.append(message)

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


def carry_out(spec: Spec, out: Path, store: Path, progress: Silent | None = None) -> RunDirectory:
    """A whole reproduction in this process, without tracking."""
    settings = Settings(out, store, executor="serial", tracking_uri="none")
    return reproduce(spec, settings, progress or Silent())


def promised_bytes(run: Path) -> dict[str, bytes]:
    """The files that must not depend on how a run was carried out: episodes and every table."""
    tables = [path for path in (run / "report").iterdir() if path.suffix in (".csv", ".md", ".tex")]
    assert len(tables) >= 4
    files = [run / "episodes.parquet", run / "segments.parquet", *tables]
    return {str(file.relative_to(run)): file.read_bytes() for file in files}
