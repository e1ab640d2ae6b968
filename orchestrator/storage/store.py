"""Content-addressed artifacts: written whole or not at all, checked on every read."""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import read_array
from safetensors import SafetensorError
from safetensors.numpy import load as load_safetensors
from safetensors.numpy import save as save_safetensors

from analysis.files import sync
from orchestrator.errors import IncompleteError, StorageError, UsageError

USUAL_STORE = Path("runs/store")
Arrays = dict[str, np.ndarray]


class CorruptArtifactError(IncompleteError):
    """An artifact's bytes are not those that were written; the next command rebuilds it."""


@dataclass(frozen=True)
class Artifact:
    """Named arrays and a plain description: what builders return and the store keeps."""

    arrays: Arrays
    info: dict[str, Any]

    @property
    def digest(self) -> str:
        """Hash of the content, independent of when and where it was made."""
        content = hashlib.sha256()
        for name, data in sorted(self.files().items()):
            content.update(f"{name}:{len(data)}:".encode() + data)
        return content.hexdigest()

    def files(self) -> dict[str, bytes]:
        """The content as files: datasets a .npy a column, which numpy reads anywhere;
        weights as one safetensors file."""
        info = {"info.json": json.dumps(self.info, sort_keys=True).encode()}
        if self.info.get("format") == "columns":
            return info | {f"{name}.npy": _npy(array) for name, array in self.arrays.items()}
        arrays = {name: np.asarray(array, order="C") for name, array in self.arrays.items()}
        return info | {"arrays.safetensors": save_safetensors(arrays)}


class Store:
    """A folder of artifacts by kind and key. Many runs may share it."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def path(self, kind: str, key: str) -> Path:
        return self.root / kind / key

    def __contains__(self, kind_and_key: tuple[str, str]) -> bool:
        return (self.path(*kind_and_key) / "manifest.json").is_file()

    def write(self, kind: str, key: str, artifact: Artifact, made: dict[str, Any]) -> str:
        """Write under a temporary name, flush to disk, rename; returns the content digest.

        `made` records how the artifact came to be (recipe, seconds); it is no part of the digest.
        Raises StorageError when the disk is full; nothing half-written stays visible.
        """
        if self._holds(kind, key, artifact):  # another run over this store was faster
            return artifact.digest
        final = self.path(kind, key)
        temporary = self.root / "incoming" / f"{key}-{uuid.uuid4().hex}"
        files = artifact.files()
        manifest = {
            "digest": artifact.digest,
            "files": {name: hashlib.sha256(data).hexdigest() for name, data in files.items()},
            "made": made,
        }
        with storage_errors(self.root):
            try:
                make_folder(temporary)
                for name, data in files.items():
                    write_durably(temporary / name, data)
                text = json.dumps(manifest, sort_keys=True, indent=1)
                write_durably(temporary / "manifest.json", text.encode())
                make_folder(final.parent)
                _replace_folder(temporary, final)
                sync(final.parent)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
        return artifact.digest

    def _holds(self, kind: str, key: str, artifact: Artifact) -> bool:
        try:
            return self.read(kind, key).digest == artifact.digest
        except CorruptArtifactError:
            return False

    def demand(self, kind: str, key: str) -> Artifact:
        """As `read`, for who will not make what is missing: UsageError says what to do."""
        if (kind, key) not in self:
            raise UsageError(
                f"{self.root} has no {kind} {key}: name the store with --store, or run the same "
                "command again, which makes it"
            )
        return self.read(kind, key)

    def read(self, kind: str, key: str) -> Artifact:
        """The artifact, every file's digest checked before any of it is used.

        Raises CorruptArtifactError naming the file that is missing or damaged.
        """
        folder = self.path(kind, key)
        manifest = self.manifest(kind, key)
        contents = {}
        for name, expected in manifest["files"].items():
            try:
                data = (folder / name).read_bytes()
            except OSError as error:
                raise CorruptArtifactError(f"{folder / name}: {error.strerror}") from error
            if hashlib.sha256(data).hexdigest() != expected:
                raise CorruptArtifactError(f"{folder / name}: content does not match its digest")
            contents[name] = data
        return _decode(contents, folder)

    def manifest(self, kind: str, key: str) -> dict[str, Any]:
        path = self.path(kind, key) / "manifest.json"
        try:
            manifest = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise CorruptArtifactError(f"{path}: unreadable") from error
        if not _is_manifest(manifest):
            raise CorruptArtifactError(f"{path}: not a manifest of this store")
        return manifest

    def discard(self, kind: str, key: str) -> Path:
        """Set a damaged artifact aside for inspection; it counts as missing from then on."""
        aside = self.root / "corrupt" / f"{kind}-{key}-{uuid.uuid4().hex[:8]}"
        with storage_errors(self.root):
            make_folder(aside.parent)
            with suppress(FileNotFoundError):  # another run over this store was faster
                self.path(kind, key).rename(aside)
        return aside

    def checkpoints(self, key: str) -> Path:
        """Where trainings of an artifact may leave checkpoints: only who sees this store does."""
        folder = self.checkpoint_folder(key)
        make_folder(folder.parent)
        return folder

    def drop_checkpoints(self, key: str) -> None:
        """Once the artifact is there they are of no use."""
        shutil.rmtree(self.checkpoint_folder(key), ignore_errors=True)

    def unfinished(self) -> Iterator[tuple[str, Path]]:
        """Keys of artifacts whose trainings have left checkpoints, and where."""
        for folder in sorted(self.checkpoint_folder("").glob("*")):
            yield folder.name, folder

    def checkpoint_folder(self, key: str) -> Path:
        """The same, to look into; makes nothing."""
        return self.root.resolve() / "checkpoints" / key

    def artifacts(self) -> Iterator[tuple[str, str]]:
        """All complete artifacts."""
        for manifest in sorted(self.root.glob("*/*/manifest.json")):
            if manifest.parent.parent.name not in ("incoming", "corrupt"):
                yield manifest.parent.parent.name, manifest.parent.name


def _npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array, order="C"), allow_pickle=False)
    return buffer.getvalue()


def _is_manifest(plain: Any) -> bool:
    """Whether `write` can have written this; file names must not lead out of the folder."""
    return (
        isinstance(plain, dict)
        and {"digest", "files", "made"} <= plain.keys()
        and isinstance(plain["files"], dict)
        and "info.json" in plain["files"]
        and all(Path(name).name == name for name in plain["files"])
    )


def _decode(contents: dict[str, bytes], folder: Path) -> Artifact:
    """An artifact from checked bytes. Nothing is unpickled, whatever the files claim to be."""
    try:
        info = json.loads(contents.pop("info.json"))
        if "arrays.safetensors" in contents:
            # safetensors hands out read-only views of the buffer; torch wants to own its memory.
            loaded = load_safetensors(contents["arrays.safetensors"])
            return Artifact({name: np.array(array) for name, array in loaded.items()}, info)
        arrays = {
            # Not np.load, which takes archives and pickles for arrays, too.
            name.removesuffix(".npy"): read_array(io.BytesIO(data), allow_pickle=False)
            for name, data in contents.items()
        }
    except (SafetensorError, ValueError) as error:
        raise CorruptArtifactError(f"{folder}: {error}") from error
    return Artifact(arrays, info)


def _replace_folder(source: Path, target: Path) -> None:
    """Rename over a folder that may be there, or be put there by another writer meanwhile.

    The old one is moved aside whole, so that no reader meets half of it.
    """
    while True:
        try:
            source.rename(target)
            return
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
        aside = source.with_name(f"{source.name}-{uuid.uuid4().hex}")
        with suppress(FileNotFoundError):  # another writer has moved it aside
            target.rename(aside)
            shutil.rmtree(aside)


def write_durably(path: Path, data: bytes) -> None:
    """Write and flush to the device."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_atomically(path: Path, data: bytes) -> None:
    """Replace a file so that a reader, or a crash, sees the old content or the new, whole.

    Threads and processes may replace the same file at once: the last one wins.
    """
    with storage_errors(path):
        make_folder(path.parent)
        temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
        try:
            write_durably(temporary, data)
            temporary.replace(path)
            sync(path.parent)
        finally:
            temporary.unlink(missing_ok=True)


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
REFUSED = (
    errno.EROFS, errno.EACCES, errno.EPERM, errno.EEXIST, errno.ENOTDIR, errno.EISDIR, errno.ELOOP,
    errno.ENAMETOOLONG, errno.ENOTSUP, errno.ENOLCK, errno.EIO, errno.ESTALE,
)  # fmt: skip


@contextmanager
def storage_errors(where: Path) -> Iterator[None]:
    """Turn what a full disk, or one that refuses to be written to, raises into StorageError."""
    try:
        yield
    except OSError as error:
        if error.errno not in FULL + REFUSED:
            raise
        raise _cannot_write(where, error) from error


def make_folder(folder: Path) -> None:
    """Make a folder and those above it. StorageError where that fails: the place is the reason.

    Elsewhere a file that is not found may be a mistake of ours; here it is, as in /proc, a folder
    in which nothing can be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _cannot_write(folder, error) from error


def _cannot_write(where: Path, error: OSError) -> StorageError:
    advice = "make room" if error.errno in FULL else "choose another place"
    return StorageError(
        f"cannot write {where}: {error.strerror}; {advice} and run the same command again"
    )
