"""The command that makes a sweep again, from what its directory remembers."""

from __future__ import annotations

import shlex

from orchestrator.spec.structure import Plain
from orchestrator.storage.rundir import RunDirectory

SOURCE = "source.json"  # the name or file that the sweep was read from


def command(directory: RunDirectory, sweep: Plain) -> str:
    """ "skillstitch sweep kitchen-search --scale quick --trials 40": the same study anywhere.

    sweep: what `directory` was asked, as sweep.json has it.
    """
    words = ["skillstitch", "sweep", directory.read_json(SOURCE) or sweep["name"]]
    words += ["--scale", sweep["scale"]]
    if sweep["sampler"] != "grid":
        words += ["--trials", str(sweep["trials"])]
    return shlex.join(words)


def command_here(directory: RunDirectory, sweep: Plain) -> str:
    """The same, in this directory and over the store that it has used."""
    words = [command(directory, sweep), "--out", shlex.quote(str(directory.path))]
    return " ".join([*words, "--store", shlex.quote(str(directory.store_root))])
