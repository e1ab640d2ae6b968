"""Single bits that flip: in an artifact, and in any file of a finished run or of its store."""

import json
from pathlib import Path

import numpy as np

from orchestrator.errors import IncompleteError, SkillstitchError
from tests.campaign.ground import Fault, Ground, randomness
from tests.orchestrator.tiny import Place


def artifact(ground: Ground, trial: int) -> str:
    """It is set aside and made again, before anything is played with it."""
    rng = randomness("artifact", trial)
    place = ground.trained()
    file = _any_file(place.store_root, rng)
    flipped = _flip(file, rng)
    ground.resume(place)
    undisturbed = ground.undisturbed.root / file.relative_to(place.root)
    set_aside = list((place.store_root / "corrupt").glob("*"))
    assert set_aside or _same(file, undisturbed)
    return f"{flipped} of {file.relative_to(place.root)}: {len(set_aside)} set aside"


def anything(ground: Ground, trial: int) -> str:
    """The same command repairs it, or says what is damaged; then that is moved away, or another
    --out is named: what the store still has is enough."""
    rng = randomness("anything", trial)
    place = ground.done()
    file = _any_file(place.root, rng)
    flipped = _flip(file, rng)
    done = f"{flipped} of {file.relative_to(place.root)}"
    try:
        if file.parent == place.out and file.name.startswith("ledger"):
            return f"{done}: {_of_the_ledger(ground, place)}"
        ground.resume(place)
        return f"{done}: repaired, or without effect"
    except SkillstitchError as error:
        refusal = str(error)
    if file.exists():  # else it was set aside already
        file.rename(place.root / "moved-away")
    try:
        ground.resume(place)
    except SkillstitchError:
        place.out.rename(place.root / "another")
        ground.resume(place)
    return f"{done}: {refusal}"


def _same(file: Path, undisturbed: Path) -> bool:
    """But for how long its making took, which only a manifest tells."""
    if file.name == "manifest.json":
        ours, theirs = (json.loads(each.read_text()) for each in (file, undisturbed))
        return bool(ours["digest"] == theirs["digest"])
    return file.read_bytes() == undisturbed.read_bytes()


def _of_the_ledger(ground: Ground, place: Place) -> str:
    """It is read where work is left. A name that has changed stays, and nothing asks for it."""
    place.directory.mark(finished=False)
    try:
        place.carry_out(ground.spec)
    except IncompleteError as error:
        if "the same command plays it again" not in str(error):
            raise
        place.carry_out(ground.spec)
    ground.check_tables(place)
    unknown = place.finished_blocks() - set(ground.outcomes)
    assert set(ground.outcomes) <= place.finished_blocks()
    assert len(unknown) <= 1
    return "a block's name has changed" if unknown else "repaired, or without effect"


def _any_file(folder: Path, rng: np.random.Generator) -> Path:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.stat().st_size)
    return files[rng.integers(len(files))]


def _flip(file: Path, rng: np.random.Generator) -> str:
    data = bytearray(file.read_bytes())
    byte, bit = int(rng.integers(len(data))), int(rng.integers(8))
    data[byte] ^= 1 << bit
    file.write_bytes(data)
    return f"bit {bit} of byte {byte}"


FAULTS = (
    Fault("a bit of an artifact flipped", artifact, 100, (0, 1)),
    Fault("a bit of any file of a finished run flipped", anything, 150, (0, 1)),
)
