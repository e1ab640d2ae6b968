"""A dataset of people's own, as a file of theirs has it."""

from __future__ import annotations

from collections.abc import Mapping

from orchestrator.builders.parts import Builder, Inputs, as_artifact
from orchestrator.spec.structure import Plain
from orchestrator.storage.store import Artifact
from stitching.data.own.labelled import labelled_data
from stitching.data.own.recordings import recordings
from stitching.envs.protocol import Benchmark

CODE = ("stitching.data.own.labelled", "stitching.data.own.recordings")
SETUP = ("orchestrator.builders.own_data", "orchestrator.builders.parts")


def own_data_builder(benchmarks: Mapping[str, Benchmark], code: tuple[str, ...]) -> Builder:
    """Of labelled episodes in the file that `data.file` names.

    benchmarks: by name. code: the modules that say what these are.
    """

    def make(params: Plain, inputs: Inputs) -> Artifact:
        benchmark, source = benchmarks[params["benchmark"]], params["config"]["file"]
        return as_artifact(labelled_data(source, recordings(source, benchmark), benchmark))

    return Builder(make, (*CODE, *code), SETUP, by_driver=True)
