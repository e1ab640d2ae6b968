"""Where trainings of one artifact leave their checkpoints: a folder, and a file for each training.

Apart from the trainings themselves: an edit here changes no model.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from orchestrator.errors import StorageError
from orchestrator.storage.store import write_atomically
from stitching.models.checkpoints import Checkpoint
from stitching.models.training import Curves
from stitching.streams import Label

FORMAT = 1
"""Of the files: those of another one count as none."""

SECONDS_BETWEEN_NEWS = 2.0

NEWS = ".news"
"""Ends the name of a file that tells how far a training is."""

PLAIN = "plain"
"""The tensor whose bytes are JSON: all that is no tensor."""


@dataclass
class Checkpoints:
    """The folder must belong to one artifact: trainings in it are told apart by their labels alone.

    It is made when it is needed; the folder around it must be there.
    """

    folder: Path | None  # None: nowhere
    earlier: float = 0.0  # seconds that went into what was found, before this attempt
    _started: float = field(default_factory=time.perf_counter)

    def of(self, labels: tuple[Label, ...]) -> Checkpoint | None:
        """The checkpoint of a training; None where there is no folder that can be seen from here.

        Workers of other versions of torch and numpy, or with other instructions, go on with their
        own: they round otherwise.
        """
        # Path.is_dir raises on EACCES.
        if self.folder is None or not os.path.isdir(self.folder.parent):
            return None
        where = [FORMAT, torch.__version__, np.__version__, torch.backends.cpu.get_cpu_capability()]
        told_apart = json.dumps([*where, *labels], default=int)
        name = hashlib.blake2b(told_apart.encode(), digest_size=16).hexdigest()
        return CheckpointFile(self.folder / name, self, labels)

    @property
    def spent(self) -> float:
        """Seconds of this attempt and of those whose checkpoints it went on from."""
        return self.earlier + time.perf_counter() - self._started


@dataclass
class CheckpointFile:
    """A digest, then tensors and what is plain; beside it, how far the training is."""

    path: Path
    build: Checkpoints  # whose it is
    labels: tuple[Label, ...] = ()  # of the training
    _told: float = -math.inf  # when, on the monotonic clock

    def write(self, tensors: dict[str, torch.Tensor], plain: dict[str, Any]) -> None:
        """Replace the file whole; a disk that refuses costs the checkpoint alone."""
        kept = {"plain": plain, "seconds": self.build.spent}
        text = np.frombuffer(json.dumps(kept, default=np.ndarray.tolist).encode(), dtype=np.uint8)
        whole = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
        data = save(whole | {PLAIN: torch.from_numpy(text.copy())})
        with suppress(OSError, StorageError):
            write_atomically(self.path, _digest(data) + data)

    def tell(
        self, done: int, updates: int, curves: Mapping[str, Sequence[tuple[int, float]]]
    ) -> None:
        """Now and then, and at the end; where the disk refuses, nobody is told."""
        now = time.monotonic()
        if done < updates and now - self._told < SECONDS_BETWEEN_NEWS:
            return
        self._told = now
        losses = {name: curve[-1][1] for name, curve in curves.items() if curve}
        news = {"done": done, "updates": updates, "losses": losses}
        news |= {"labels": self.labels, "curves": curves}
        text = json.dumps(news, default=int)
        with suppress(OSError):
            self.path.parent.mkdir(exist_ok=True)
            self.path.with_name(f"{self.path.name}{NEWS}").write_text(text, encoding="utf-8")

    def read(self) -> tuple[dict[str, torch.Tensor], dict[str, Any]] | None:
        try:
            content = self.path.read_bytes()
        except OSError:
            return None
        digest, data = content[:32], content[32:]
        if digest != _digest(data):
            return None
        try:
            tensors = load(data)
            kept = json.loads(tensors.pop(PLAIN).numpy().tobytes())
        except (SafetensorError, KeyError, ValueError):
            return None
        self.build.earlier = max(self.build.earlier, kept["seconds"])
        return tensors, kept["plain"]


@dataclass(frozen=True)
class News:
    """How far the trainings of an artifact are."""

    done: int  # updates, of all its trainings that have begun
    updates: int
    losses: dict[str, float]  # recorded last, of the one that is under way
    trainings: int = 1  # that have begun


def news_of(folder: Path, since: float = 0.0) -> News | None:
    """What the trainings that keep checkpoints in a folder tell; None where they tell nothing.

    since: seconds of the epoch; what was told before is of an attempt that has ended.
    """
    told = _told(folder, since)
    if not told:
        return None
    _, newest = max(told, key=lambda news: news[0])
    done, updates = (sum(news[name] for _, news in told) for name in ("done", "updates"))
    return News(done, updates, newest["losses"], len(told))


def curves_of(folder: Path, since: float = 0.0) -> list[tuple[list[Label], Curves]]:
    """Labels and curves so far of each training that keeps checkpoints here, as `news_of`."""
    return [(news["labels"], news["curves"]) for _, news in _told(folder, since)]


def _told(folder: Path, since: float) -> list[tuple[float, dict[str, Any]]]:
    """When each training in a folder has told something last, and what."""
    told = []
    with suppress(OSError):  # the folder goes once the artifact is there
        for file in sorted(folder.glob(f"*{NEWS}")):
            with suppress(OSError, ValueError):  # it is being written, or is gone
                if (when := file.stat().st_mtime) >= since:
                    told.append((when, json.loads(file.read_text(encoding="utf-8"))))
    return told


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()
