"""Both robosuite tasks from data to Table 3, small, with experts' data and their own simulator."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from orchestrator.spec.spec import Spec, load_spec
from orchestrator.work.plan import make_plan
from stitching.methods.mb_stitch import MBStitchSettings
from stitching.methods.mf_stitch import MFStitchSettings
from stitching.methods.random_stitch import RandomStitchSettings
from stitching.models.dynamics import DynamicsConfig
from stitching.models.iql import IQLConfig
from stitching.planning.cem import CEM
from tests.orchestrator.tiny import Alone, Place
from tests.sections import fields_of, section, with_sections

pytestmark = pytest.mark.slow


def small(name: str) -> Spec:
    spec = load_spec(name, "smoke")
    skills = IQLConfig(
        updates=400, learning_rate=1e-3, dropout=0.0, members=2, width=32, policy_width=128,
        multi_task=False, log_every=200,
    )  # fmt: skip
    sections = fields_of(
        spec,
        replace(section(spec, RandomStitchSettings), limit=2),
        replace(section(spec, MFStitchSettings), limit=2, training=replace(skills, updates=50)),
        with_sections(
            replace(section(spec, MBStitchSettings), limit=2),
            CEM(population=16, elites=4, iterations=5),
        ),
    )
    return replace(
        spec,
        data=replace(spec.data, quality=1.0, episodes=6, held_out=2),
        agent=skills,
        dynamics=DynamicsConfig(updates=100, width=32, members=2, activation="sigmoid"),
        **sections,
    )


@pytest.mark.parametrize(
    ("name", "methods"),
    [
        ("table3-door", ("no-stitch", "random-stitch", "mf-stitch", "mb-stitch")),
        ("table3-can", ("no-stitch", "mb-stitch")),
    ],
)
def test_a_task_from_data_to_report(
    name: str, methods: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory
) -> None:
    spec, place = replace(small(name), methods=methods), Place(tmp_path_factory.mktemp(name))
    place.carry_out(spec)
    plan = make_plan(spec)
    (task,) = spec.all_tasks
    for method in spec.methods:
        alone = Alone(plan, place, 0, method, task, chunk=0)
        assert alone.depth_of_the_same_bytes() >= 1
    episodes = pd.read_parquet(place.out / "episodes.parquet")
    assert len(episodes) == len(spec.methods) * spec.episodes
    diagnosis = json.loads((place.out / "diagnosis.json").read_text())
    assert set(diagnosis["competence"]) == set(spec.skill_names)
    study = json.loads((place.out / "stitches.json").read_text())
    assert [(pair["first"], pair["second"]) for pair in study["pairs"]] == [task]
    assert len(study["stitches"]) == study["pairs"][0]["arrived"]
    assert (place.out / "report" / f"{name}.md").is_file()
    showcase = json.loads((place.out / "showcase.json").read_text())
    shown = showcase["episodes"]
    assert [episode["method"] for episode in shown] == ["no-stitch", "mb-stitch"]
    for episode in shown:
        lengths = {len(episode[name]) for name in ("positions", "phase", "segment")}
        assert len(lengths) == 1
        assert lengths != {0}
        assert (list(episode["fixtures"]) == ["Door_main"]) == (name == "table3-door")
    assert showcase["model"].startswith("<mujoco")
