"""Artifacts: whole or not there, checked before use, never executed, safe on a full disk."""

import errno
import hashlib
import io
import json
import multiprocessing
import os
import pickle
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save as save_safetensors

from orchestrator.errors import StorageError
from orchestrator.spec.spec import Spec
from orchestrator.storage.store import (
    Artifact,
    CorruptArtifactError,
    Store,
    make_folder,
    storage_errors,
    write_atomically,
)
from tests.orchestrator.tiny import Place, promised_bytes

KEY = "0" * 32

Write = Callable[[Store, str], Artifact]


def weights(scale: float = 1.0) -> Artifact:
    arrays = {
        "policy.w0": scale * np.arange(12, dtype=np.float32).reshape(3, 4),
        "policy.b0": np.zeros(0, dtype=np.float32),
        "steps": np.array(7),
        "transposed": np.arange(6.0).reshape(2, 3).T,
    }
    return Artifact(arrays, {"curves": {"loss": [[1, 0.5]]}})


def columns() -> Artifact:
    arrays = {"observations": np.eye(3, dtype=np.float32), "ends": np.array([1, 3])}
    return Artifact(arrays, {"format": "columns", "rows": 3})


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


def same(one: Artifact, other: Artifact) -> bool:
    return one.digest == other.digest and all(
        one.arrays[name].dtype == array.dtype and np.array_equal(one.arrays[name], array)
        for name, array in other.arrays.items()
    )


@pytest.mark.parametrize("make", [weights, columns])
def test_what_is_written_is_read(store: Store, make: Callable[[], Artifact]) -> None:
    artifact = make()
    assert ("agent", KEY) not in store
    digest = store.write("agent", KEY, artifact, {"seconds": 1.0})
    assert ("agent", KEY) in store
    assert same(store.read("agent", KEY), artifact)
    assert store.read("agent", KEY).info == artifact.info
    assert store.manifest("agent", KEY)["digest"] == digest == artifact.digest
    assert store.manifest("agent", KEY)["made"] == {"seconds": 1.0}
    assert list(store.artifacts()) == [("agent", KEY)]
    assert list((store.root / "incoming").iterdir()) == []


def test_the_digest_is_of_the_content_alone(store: Store) -> None:
    """When and where it was made, and in which order its arrays were named, do not matter."""
    first = store.write("agent", KEY, weights(), {"seconds": 1.0})
    turned = Artifact(dict(reversed(weights().arrays.items())), weights().info)
    second = Store(store.root / "elsewhere").write("agent", "1" * 32, turned, {"seconds": 2.0})
    assert first == second
    assert weights(2.0).digest != first
    assert Artifact(weights().arrays, {"curves": {}}).digest != first


def test_loaded_arrays_can_be_written_to(store: Store) -> None:
    """torch.from_numpy warns about, and may corrupt, arrays that it does not own."""
    store.write("agent", KEY, weights(), {})
    assert all(array.flags.writeable for array in store.read("agent", KEY).arrays.values())


# Damage


def truncate(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1])


def flip_a_bit(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 0b100
    file.write_bytes(content)


@pytest.mark.parametrize("damage", [truncate, flip_a_bit, Path.unlink])
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (weights, "arrays.safetensors"),
        (weights, "info.json"),
        (columns, "observations.npy"),
        (columns, "ends.npy"),
    ],
)
def test_damage_is_found_and_named(
    store: Store, make: Callable[[], Artifact], name: str, damage: Callable[[Path], None]
) -> None:
    store.write("agent", KEY, make(), {})
    file = store.path("agent", KEY) / name
    damage(file)
    with pytest.raises(CorruptArtifactError, match=str(file)):
        store.read("agent", KEY)


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"null", b"{}", b'{"digest": "x", "files": {}}', b"\xff\xfe\x00"],
)
def test_a_broken_manifest_is_named(store: Store, content: bytes) -> None:
    store.write("agent", KEY, weights(), {})
    manifest = store.path("agent", KEY) / "manifest.json"
    manifest.write_bytes(content)
    for read in (store.read, store.manifest):
        with pytest.raises(CorruptArtifactError, match=str(manifest)):
            read("agent", KEY)


def test_a_damaged_artifact_is_set_aside_and_can_be_written_again(store: Store) -> None:
    store.write("agent", KEY, weights(), {})
    truncate(store.path("agent", KEY) / "arrays.safetensors")
    aside = store.discard("agent", KEY)
    assert (aside / "arrays.safetensors").is_file()
    assert ("agent", KEY) not in store
    assert list(store.artifacts()) == []
    store.write("agent", KEY, weights(), {})
    assert same(store.read("agent", KEY), weights())


def test_a_folder_without_a_manifest_counts_as_missing(store: Store) -> None:
    store.path("agent", KEY).mkdir(parents=True)
    (store.path("agent", KEY) / "arrays.safetensors").write_bytes(b"half")
    assert ("agent", KEY) not in store
    store.write("agent", KEY, weights(), {})
    assert same(store.read("agent", KEY), weights())


# Several writers


def _write_often(root: Path, started: Any, times: int) -> None:
    started.wait()
    for _ in range(times):
        Store(root).write("agent", KEY, weights(), {"pid": os.getpid()})


def test_concurrent_writers_of_the_same_key(store: Store) -> None:
    """Two runs over one store may finish the same artifact at the same moment."""
    context = multiprocessing.get_context("fork")
    started = context.Barrier(3)
    writers = [
        context.Process(target=_write_often, args=(store.root, started, 60)) for _ in range(3)
    ]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(60)
    assert [writer.exitcode for writer in writers] == [0, 0, 0]
    assert same(store.read("agent", KEY), weights())
    assert list((store.root / "incoming").iterdir()) == []


# Malice: manifests whose digests match, so that only the decoder stands in between


class Payload:
    """Creates a file when it is unpickled."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[Callable[..., int], tuple[Path, str]]:
        return Path.write_text, (self.file, "owned")


def object_array(payload: Payload) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.array([payload], dtype=object), allow_pickle=True)
    return buffer.getvalue()


def archive_of_objects(payload: Payload) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, observations=np.array([payload], dtype=object))
    return buffer.getvalue()


def plant(store: Store, files: dict[str, bytes], manifest: dict[str, Any] | None = None) -> Path:
    folder = store.path("agent", KEY)
    folder.mkdir(parents=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
    text = json.dumps({"digest": "0" * 64, "files": digests, "made": {}} | (manifest or {}))
    (folder / "manifest.json").write_text(text)
    return folder


INFO = b'{"format": "columns"}'


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("arrays.safetensors", pickle.dumps),
        ("arrays.safetensors", lambda _: b""),
        ("arrays.safetensors", lambda _: (2**62).to_bytes(8, "little") + b"{}"),
        ("observations.npy", pickle.dumps),
        ("observations.npy", object_array),
        ("observations.npy", archive_of_objects),
        ("observations.npy", lambda _: b""),
        ("observations.npy", lambda _: b"\x93NUMPY\x01\x00\x02\x00()"),
    ],
)
def test_a_malicious_checkpoint_runs_nothing(
    store: Store, tmp_path: Path, name: str, content: Callable[[Payload], bytes]
) -> None:
    mark = tmp_path / "owned"
    data = content(Payload(mark))
    folder = plant(store, {"info.json": INFO, name: data})
    with pytest.raises(CorruptArtifactError, match=str(folder)):
        store.read("agent", KEY)
    assert not mark.exists()


def test_the_payload_would_run(tmp_path: Path) -> None:
    """The test above proves something only if this bullet is live."""
    pickle.loads(pickle.dumps(Payload(tmp_path / "owned")))
    assert (tmp_path / "owned").read_text() == "owned"


@pytest.mark.parametrize(
    ("files", "manifest"),
    [
        ({"arrays.safetensors": save_safetensors({"w": np.zeros(2)})}, None),
        ({"info.json": b"not json"}, None),
        ({"info.json": INFO}, {"files": ["info.json"]}),
        ({"info.json": INFO}, {"files": {"info.json": 3}}),
    ],
)
def test_a_manifest_that_makes_no_sense(
    store: Store, files: dict[str, bytes], manifest: dict[str, Any] | None
) -> None:
    folder = plant(store, files, manifest)
    with pytest.raises(CorruptArtifactError, match=str(folder)):
        store.read("agent", KEY)


def test_a_manifest_cannot_name_files_elsewhere(store: Store, tmp_path: Path) -> None:
    secret = tmp_path / "secret.npy"
    np.save(secret, np.arange(3))
    digest = hashlib.sha256(secret.read_bytes()).hexdigest()
    info = hashlib.sha256(INFO).hexdigest()
    outside = f"../../../{secret.name}"
    folder = plant(store, {"info.json": INFO}, {"files": {"info.json": info, outside: digest}})
    assert (folder / outside).is_file()
    with pytest.raises(CorruptArtifactError, match=str(folder)):
        store.read("agent", KEY)


# A full disk


@contextmanager
def no_room(limit: int = 100) -> Iterator[None]:
    """No file of this process may grow beyond so many bytes, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("before", [False, True])
def test_a_full_disk_leaves_nothing_half_written(store: Store, before: bool) -> None:
    if before:
        store.write("agent", KEY, weights(), {})
    with no_room(), pytest.raises(StorageError, match="make room") as caught:
        store.write("agent", KEY, weights(2.0), {})
    assert caught.value.exit_code == 3
    assert list((store.root / "incoming").iterdir()) == []
    assert (("agent", KEY) in store) == before
    if before:
        assert same(store.read("agent", KEY), weights())
    store.write("agent", KEY, weights(2.0), {})
    assert same(store.read("agent", KEY), weights(2.0))


def test_files_are_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    file = tmp_path / "folder" / "spec.json"
    write_atomically(file, b"old")
    with no_room(), pytest.raises(StorageError, match=str(file)):
        write_atomically(file, b"new" * 100)
    assert file.read_bytes() == b"old"
    write_atomically(file, b"new" * 100)
    assert file.read_bytes() == b"new" * 100
    assert list(file.parent.iterdir()) == [file]


def test_threads_may_replace_the_same_file_at_once(tmp_path: Path) -> None:
    file, contents = tmp_path / "tracking.json", [bytes([n]) * 100_000 for n in range(64)]
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(partial(write_atomically, file), contents))
    assert file.read_bytes() in contents
    assert list(tmp_path.iterdir()) == [file]


def test_errors_of_other_kinds_are_not_blamed_on_the_disk(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), storage_errors(tmp_path):
        raise FileNotFoundError(errno.ENOENT, "no such file")


NOWHERE = Path("/proc/none")  # where even root can make nothing


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    for folder in (NOWHERE / "folder", tmp_path / ("a" * 300)):
        with pytest.raises(StorageError, match=rf"cannot write {folder}.*choose another place"):
            make_folder(folder)
        with pytest.raises(StorageError, match="choose another place"):
            Store(folder).write("agent", KEY, weights(), {})
        with pytest.raises(StorageError, match="choose another place"):
            write_atomically(folder / "spec.json", b"")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(folder)]
    if os.getuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("only root can mount a small disk")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def test_a_run_stops_cleanly_on_a_full_disk_and_resumes(
    spec: Spec, small_disk: Path, finished: Place
) -> None:
    """With more room each time, so that it stops at another place each time."""
    place, ballast = Place(small_disk), small_disk / "ballast"
    for kilobytes in (2, 30, 150, 300, 400):
        room = shutil.disk_usage(small_disk).free
        ballast.write_bytes(b"x" * (room - 1000 * kilobytes))
        with pytest.raises(StorageError, match="make room and run the same command again"):
            place.carry_out(spec)
        ballast.unlink()
    place.carry_out(spec)
    assert promised_bytes(place.out) == promised_bytes(finished.out)
