"""Models and data of a run, taken along and read back."""

import json
import os
import subprocess
import sys
from pathlib import Path

import minari
import numpy as np
import pytest
from safetensors.numpy import load_file

from orchestrator.errors import UsageError
from orchestrator.export import dataset_id, export_run
from orchestrator.work.plan import Plan
from tests.orchestrator.tiny import Place

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "exported_models.py"


@pytest.fixture(scope="module")
def exported(finished: Place, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("away") / "exported"
    before = os.environ.get("MINARI_DATASETS_PATH")
    (line,) = export_run(finished.directory, folder, None)
    assert line == f"exported 6 models and 2 datasets to {folder}"
    assert os.environ.get("MINARI_DATASETS_PATH") == before
    return folder


def test_every_model_is_there_as_it_was(exported: Path, finished: Place, plan: Plan) -> None:
    assert len(set(plan.models.values())) == 6  # two seeds of agent, dynamics and MF policy
    for kind in ("agent", "dynamics", "mf-policy"):
        for seed in (0, 1):
            name = exported / "models" / f"{kind}-seed-{seed}"
            card = json.loads(name.with_suffix(".json").read_text())
            assert (card["kind"], card["seed"], card["benchmark"]) == (kind, seed, "maze")
            real = finished.store.read(kind, card["key"])
            assert card["digest"] == real.digest
            weights = load_file(name.with_suffix(".safetensors"))
            assert weights.keys() == real.arrays.keys()
            for array, ours in weights.items():
                np.testing.assert_array_equal(ours, real.arrays[array])
    assert "g0" in (exported / "README.md").read_text()


def test_every_transition_is_in_the_datasets(
    exported: Path, finished: Place, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(exported / "datasets"))
    for role, key in plan.datasets.items():
        real = finished.store.read(plan.recipes[key].kind, key).arrays
        dataset = minari.load_dataset(dataset_id(plan, role))
        episodes = list(dataset.iterate_episodes())
        for name, shown in {
            "observations": [episode.observations[:-1] for episode in episodes],
            "next_observations": [episode.observations[1:] for episode in episodes],
            "actions": [episode.actions for episode in episodes],
        }.items():
            np.testing.assert_array_equal(np.concatenate(shown), real[name])
        accomplished = sum(float(np.sum(episode.rewards)) for episode in episodes)
        assert accomplished == real["episode_successes"][real["episode_skills"] >= 0].sum()
        for episode in episodes:
            assert bool(episode.terminations[-1]) != bool(episode.truncations[-1])


def test_the_example_reads_it(exported: Path) -> None:
    command = [sys.executable, str(EXAMPLE), str(exported)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "40 episodes" in done.stdout
    assert "the policy's action leads to" in done.stdout


def test_what_cannot_be_exported_is_said(done: Place, plan: Plan, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="exists; name a new folder"):
        list(export_run(done.directory, tmp_path, None))
    key = plan.by_seed("agent")[0]
    done.store.discard("agent", key)
    with pytest.raises(UsageError, match=f"has no agent {key}"):
        list(export_run(done.directory, tmp_path / "new", done.store_root))
    assert not (tmp_path / "new").exists()
