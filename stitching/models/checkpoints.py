"""Checkpoints of trainings: a killed one goes on from its last and ends with the same bytes.

Who starts trainings says where they may leave checkpoints, with `checkpoints_in`. Without it, or
where that folder cannot be seen or written, none are left and nothing else changes.
"""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from stitching.streams import Label

_FOLDER: ContextVar[Path | None] = ContextVar("checkpoints", default=None)
_PLAIN = "plain"  # the tensor whose bytes are JSON: all that is no tensor


@contextmanager
def checkpoints_in(folder: Path | None) -> Iterator[None]:
    """Trainings within this context leave their checkpoints in `folder` and go on from them.

    The folder must belong to one setting: trainings in it are told apart by their labels alone.
    It is made when it is needed; the folder around it must be there.
    """
    token = _FOLDER.set(folder)
    try:
        yield
    finally:
        _FOLDER.reset(token)


@dataclass(frozen=True)
class Checkpoint:
    """The file of one training: a digest, then tensors and what is plain."""

    path: Path

    @classmethod
    def of(cls, *labels: Label) -> Checkpoint | None:
        """That of the training with these labels; None where none are to be left.

        Workers of other versions of torch and numpy, or with other instructions, go on with their
        own: they round otherwise.
        """
        folder = _FOLDER.get()
        if folder is None or not os.path.isdir(folder.parent):  # Path.is_dir raises on EACCES
            return None
        where = [torch.__version__, np.__version__, torch.backends.cpu.get_cpu_capability()]
        told_apart = json.dumps([*where, *labels], default=int)
        name = hashlib.blake2b(told_apart.encode(), digest_size=16).hexdigest()
        return cls(folder / name)

    def write(self, tensors: dict[str, Tensor], plain: dict[str, Any]) -> None:
        """Replace the file whole; a disk that refuses costs the checkpoint alone.

        Arrays in `plain` come back as lists.
        """
        text = np.frombuffer(json.dumps(plain, default=np.ndarray.tolist).encode(), dtype=np.uint8)
        data = save({name: tensor.detach().contiguous() for name, tensor in tensors.items()}
                    | {_PLAIN: torch.from_numpy(text.copy())})  # fmt: skip
        temporary = self.path.with_name(f"{self.path.name}.{uuid.uuid4().hex}.tmp")
        with suppress(OSError):
            self.path.parent.mkdir(exist_ok=True)
            try:
                temporary.write_bytes(_digest(data) + data)
                temporary.replace(self.path)
            finally:
                temporary.unlink(missing_ok=True)

    def read(self) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
        """What was written last; None where there is nothing, or nothing whole."""
        try:
            content = self.path.read_bytes()
        except OSError:
            return None
        digest, data = content[:32], content[32:]
        if digest != _digest(data):
            return None
        try:
            tensors = load(data)
        except SafetensorError:
            return None
        return tensors, json.loads(tensors.pop(_PLAIN).numpy().tobytes())


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()
