"""Episodes of a ledger, played again step by step, and the films made of them."""

from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
import torch

from orchestrator.episodes.film import film
from orchestrator.episodes.replay import Asked, replay
from orchestrator.errors import ChangedError, NondeterminismError, UsageError
from orchestrator.spec.spec import Spec
from orchestrator.storage.store import Artifact
from orchestrator.work.plan import Plan
from tests.orchestrator.tiny import Place

TASK = ("g0", "g3")


def recorded_steps(place: Place, plan: Plan, asked: Asked, number: int) -> tuple[int, int]:
    """Skills accomplished and steps used, from the ledger."""
    ledger = place.directory.ledger(read_only=True)
    accomplished = steps = 0
    for (node, _), task in plan.tasks.items():
        player = asked.method if len(node.prefix) > 1 else plan.first_method(asked.method)
        if (node.seed, node.method) != (asked.seed, player):
            continue
        if node.prefix != asked.task[: len(node.prefix)]:
            continue
        for _, outcome in ledger.outcomes([task.key]):
            for row in np.flatnonzero(outcome.arrays["episode"] == number):
                accomplished += int(outcome.arrays["success"][row])
                steps += int(outcome.arrays["steps"][row])
    ledger.close()
    return accomplished, steps


@pytest.mark.parametrize("method", ["no-stitch", "random-stitch", "mf-stitch", "mb-stitch"])
def test_it_does_what_is_on_record(finished: Place, plan: Plan, method: str) -> None:
    for number in range(plan.spec.episodes):
        asked = Asked(TASK, method, seed=1, episode=number)
        shown = replay(finished.directory, asked)
        (episode,) = shown["episodes"]
        accomplished, steps = recorded_steps(finished, plan, asked, number)
        assert episode["accomplished"] == accomplished
        assert len(episode["segment"]) == len(episode["phases"]) == steps
        assert len(episode["positions"]) == steps + 1
        if accomplished == 2:
            assert episode["positions"][-1] == shown["goals"]["g3"]


def test_by_default_it_is_one_that_accomplishes_most(finished: Place, plan: Plan) -> None:
    for method in plan.spec.methods:
        asked = Asked(TASK, method)
        every = [recorded_steps(finished, plan, asked, n)[0] for n in range(plan.spec.episodes)]
        shown = replay(finished.directory, asked)
        assert shown["episode"] == int(np.argmax(every))
        assert shown["episodes"][0]["accomplished"] == max(every)


def test_a_task_of_one_skill_may_be_shared(trained: Place, spec: Spec) -> None:
    single = replace(spec, tasks=("g0",), step_limits={1: 20}, methods=("no-stitch",))
    assert replay(trained.carry_out(single), Asked(("g0",), "no-stitch"))["episodes"][0][
        "accomplished"
    ] in (0, 1)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (Asked(("g3", "g0"), "no-stitch"), "has no task 'g3>g0'; it has g0>g1"),
        (Asked(TASK, "reach-stitch"), "has no method 'reach-stitch'; it has no-stitch"),
        (Asked(TASK, "no-stitch", seed=2), "has no seed 2; they go from 0 to 1"),
        (Asked(TASK, "no-stitch", episode=6), "has no episode 6; they go from 0 to 5"),
    ],
)
def test_what_is_not_there_is_said(finished: Place, asked: Asked, told: str) -> None:
    with pytest.raises(UsageError, match=told):
        replay(finished.directory, asked)


def test_what_was_not_played_is_said(done: Place, plan: Plan) -> None:
    ledger = done.directory.ledger()
    ledger.forget([task.key for task in plan.tasks.values()])
    ledger.close()
    with pytest.raises(UsageError, match="is not on record"):
        replay(done.directory, Asked(TASK, "no-stitch", episode=0))


def test_a_model_that_is_not_there_is_named(done: Place, plan: Plan, tmp_path: Path) -> None:
    asked = Asked(TASK, "no-stitch", episode=0)
    with pytest.raises(UsageError, match=r"no store at .*nowhere"):
        replay(done.directory, asked, tmp_path / "nowhere")
    assert not (tmp_path / "nowhere").exists()
    key = plan.by_seed("agent")[0]
    done.store.discard("agent", key)
    with pytest.raises(UsageError, match=f"has no agent {key}: name the store with --store"):
        replay(done.directory, asked, done.store_root)


def test_another_model_is_refused(done: Place, plan: Plan) -> None:
    key = plan.by_seed("agent")[0]
    real = done.store.read("agent", key)
    done.store.discard("agent", key)
    weights = {name: array + 1 for name, array in real.arrays.items()}
    done.store.write("agent", key, Artifact(weights, real.info), {})
    with pytest.raises(ChangedError, match="has other bytes than the one that"):
        replay(done.directory, Asked(TASK, "no-stitch", episode=0), done.store_root)


def test_the_threads_of_the_caller_are_as_before(finished: Place) -> None:
    torch.set_num_threads(2)
    replay(finished.directory, Asked(TASK, "no-stitch", episode=0))
    assert torch.get_num_threads() == 2
    torch.set_num_threads(1)


def test_another_outcome_is_an_error(done: Place, plan: Plan) -> None:
    asked = Asked(TASK, "no-stitch", episode=0)
    key = next(
        task.key
        for (node, chunk), task in plan.tasks.items()
        if node.prefix == ("g0",) and not chunk
    )
    ledger = done.directory.ledger()
    ((_, outcome),) = ledger.outcomes([key])
    ledger.forget([key])
    outcome.arrays["steps"] = outcome.arrays["steps"] + 1
    ledger.record([(key, outcome.to_bytes())])
    ledger.close()
    with pytest.raises(NondeterminismError, match="something else here than on record"):
        replay(done.directory, asked)


def test_a_film_has_a_frame_a_step(finished: Place, tmp_path: Path) -> None:
    asked = Asked(TASK, "mb-stitch")
    path = tmp_path / "films" / "one.mp4"
    told = "\n".join(film(finished.directory, asked, out=path))
    assert "exactly as on record" in told
    assert str(path) in told
    assert path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    steps = len(replay(finished.directory, asked)["episodes"][0]["phases"])
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == steps + 1 + 8  # the start, and the end held for a while
    assert not list(path.parent.glob(".*"))


def test_a_film_lies_with_its_run(done: Place) -> None:
    told = list(film(done.directory, Asked(TASK, "no-stitch", episode=1)))
    path = done.out / "episodes" / "g0_g3_no-stitch_seed-0_episode-1.mp4"
    assert path.is_file()
    assert str(path) in told[-1]


def test_a_film_is_an_mp4(finished: Place) -> None:
    with pytest.raises(UsageError, match=r"ends with \.mp4"):
        list(film(finished.directory, Asked(TASK, "mb-stitch"), out=Path("film.gif")))
