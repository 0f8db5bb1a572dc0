# SPDX-License-Identifier: Apache-2.0
"""A mesh as text is the same mesh; the cache on disk gives back what was stored, whole or not at all."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.files import stored_mesh as packing
from gdfe_ros.mesh.files.stored_mesh import keep, key_of, pack_mesh, recall, unpack_mesh
from gdfe_ros.mesh.generators import sphere

MESH = sphere(0.01, 0.02, [3, 2])


def test_a_packed_mesh_is_the_same_mesh() -> None:
    """Vertices, cells and sets are unpacked unchanged, with names of all sorts."""
    named = HexMesh(MESH.vertices, MESH.cells, {"a/b é": np.array([1, 2])}, MESH.vertex_sets)
    copy = unpack_mesh(pack_mesh(named))
    np.testing.assert_array_equal(copy.vertices, named.vertices)
    np.testing.assert_array_equal(copy.cells, named.cells)
    assert copy.cell_sets["a/b é"].tolist() == [1, 2]
    assert {k: v.tolist() for k, v in copy.vertex_sets.items()} == {k: v.tolist() for k, v in named.vertex_sets.items()}


@pytest.mark.parametrize("text", ["", "xx", "AAAA", "é", pack_mesh(MESH)[:-400], pack_mesh(MESH)[400:]])
def test_damaged_text_is_refused(text: str) -> None:
    """Damaged text is refused with the embedded mesh and a remedy."""
    with pytest.raises(MeshError, match=r"the embedded mesh.*\n.*damaged"):
        unpack_mesh(text)


ARRAYS = {"positions": np.linspace(0.0, 1.0, 30_000).reshape(-1, 3), "name": np.array("a body")}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of the stored files."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path / "gdfe_ros_bodies"


def test_arrays_come_back_bit_by_bit() -> None:
    """Stored arrays are read bit by bit, and nothing is read with another key."""
    keep(key_of(b"one"), ARRAYS)
    found = recall(key_of(b"one"))
    assert found is not None
    assert found.keys() == ARRAYS.keys()
    assert all(np.array_equal(found[name], array) for name, array in ARRAYS.items())
    assert recall(key_of(b"two")) is None


def test_a_key_tells_contents_apart() -> None:
    """Keys differ for parts that are divided differently, and for another version of the code."""
    keys = {key_of(b"ab", b"c"), key_of(b"a", b"bc"), key_of(b"abc")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packing, "_code", lambda: b"another version")
        keys.add(key_of(b"abc"))
    assert len(keys) == 4


@pytest.mark.parametrize("left", [0, 10, 1000, -1])
def test_a_file_that_was_cut_off_is_not_read(folder: Path, left: int) -> None:
    """A file with only its first bytes is not read, and is stored anew."""
    keep("key", ARRAYS)
    path = folder / "key.npz"
    path.write_bytes(path.read_bytes()[:left])
    assert recall("key") is None
    keep("key", ARRAYS)
    assert recall("key") is not None


def _keep_often(number: int) -> bool:
    return all(_kept_and_whole() for _ in range(20))


def _kept_and_whole() -> bool:
    keep("key", ARRAYS)
    found = recall("key")
    return found is not None and np.array_equal(found["positions"], ARRAYS["positions"])


def test_two_processes_share_the_folder(folder: Path) -> None:
    """Two processes that write and read one key at once always read a complete file."""
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:
        assert all(pool.map(_keep_often, range(2)))
    assert [path.name for path in folder.iterdir()] == ["key.npz"]


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the folder cannot be made, nothing is stored, and no error is raised."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    keep("key", ARRAYS)
    assert recall("key") is None


def test_the_files_used_least_recently_are_deleted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The least recently used files are deleted, so that the folder stays within the allowed size."""
    keep("old", ARRAYS)
    size = (folder / "old.npz").stat().st_size
    monkeypatch.setattr(packing, "MOST_BYTES", int(1.5 * size))
    keep("new", ARRAYS)
    assert recall("old") is None
    assert recall("new") is not None
