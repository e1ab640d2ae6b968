"""`skillstitch enjoy`: an episode of a run as a film, and as a contact sheet beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from analysis.figures.showcase.film import write_film
from analysis.figures.showcase.scenes import NoPictureError
from analysis.figures.showcase.showcases import write_picture
from analysis.run import load_run_spec
from analysis.schema import SEPARATOR
from orchestrator.episodes.replay import Asked, replay
from orchestrator.errors import UsageError
from orchestrator.storage.rundir import RunDirectory
from orchestrator.storage.store import make_folder, storage_errors


def film(
    directory: RunDirectory, asked: Asked, store: Path | None = None, out: Path | None = None
) -> Iterator[str]:
    """Replay an episode, draw it, and say what was written.

    Raises what `replay` does; UsageError where nothing can be drawn here.
    """
    if out is not None and out.suffix != ".mp4":
        raise UsageError(f"--out {out}: a film's name ends with .mp4")
    shown = replay(directory, asked, store)
    (episode,) = shown["episodes"]
    skills = len(asked.task)
    yield (
        f"{asked.method}, {SEPARATOR.join(asked.task)}, seed {asked.seed}, episode "
        f"{shown['episode']}: {episode['accomplished']} of {skills} skills in "
        f"{len(episode['segment'])} steps, exactly as on record"
    )
    spec = load_run_spec(directory.path)
    parts = [*asked.task, asked.method, f"seed-{asked.seed}", f"episode-{shown['episode']}"]
    name = "_".join(part.replace(" ", "-").replace("/", "-") for part in parts)
    path = out or directory.path / "episodes" / f"{name}.mp4"
    make_folder(path.parent)
    with storage_errors(path.parent):
        try:
            write_film(shown, spec, path)
            write_picture(shown, spec, path.with_suffix(".png"))
        except NoPictureError as error:
            raise UsageError(str(error)) from None
    yield f"wrote {path} and {path.with_suffix('.png').name}"
