"""The command that makes a sweep again, from what its directory remembers."""

from __future__ import annotations

import shlex
from pathlib import Path

from orchestrator.spec.structure import Plain
from orchestrator.storage.rundir import RunDirectory

SOURCE = "source.json"  # the name or file that the sweep was read from


def command(directory: RunDirectory, sweep: Plain) -> str:
    """ "skillstitch sweep kitchen-search --scale quick --trials 40": the same study anywhere.

    A file has its name only: a report is kept where the folders of this machine are not.
    sweep: what `directory` was asked, as sweep.json has it.
    """
    return _command(Path(_source(directory, sweep)).name, sweep)


def command_here(directory: RunDirectory, sweep: Plain) -> str:
    """The same, in this directory and over the store that it has used."""
    words = [_command(_source(directory, sweep), sweep), "--out", shlex.quote(str(directory.path))]
    return " ".join([*words, "--store", shlex.quote(str(directory.store_root))])


def _source(directory: RunDirectory, sweep: Plain) -> str:
    return str(directory.read_json(SOURCE) or sweep["name"])


def _command(source: str, sweep: Plain) -> str:
    words = ["skillstitch", "sweep", source, "--scale", sweep["scale"]]
    if sweep["sampler"] != "grid":
        words += ["--trials", str(sweep["trials"])]
    return shlex.join(words)
