# SPDX-License-Identifier: Apache-2.0
"""A mesh packed as text is unpacked bit by bit."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import sphere
from gdfe_ros.mesh.packing import pack_mesh, unpack_mesh

MESH = sphere(0.01, 0.02, [3, 2])


def test_a_packed_mesh_is_the_same_mesh() -> None:
    """Vertices, cells and sets are unpacked unchanged, with names of all sorts."""
    named = HexMesh(MESH.vertices, MESH.cells, {"a/b é": np.array([1, 2])}, MESH.vertex_sets)
    copy = unpack_mesh(pack_mesh(named))
    np.testing.assert_array_equal(copy.vertices, named.vertices)
    np.testing.assert_array_equal(copy.cells, named.cells)
    assert copy.cell_sets["a/b é"].tolist() == [1, 2]
    assert {k: v.tolist() for k, v in copy.vertex_sets.items()} == {k: v.tolist() for k, v in named.vertex_sets.items()}


def test_packing_is_deterministic() -> None:
    """Packing a mesh twice gives the same text."""
    assert pack_mesh(MESH) == pack_mesh(MESH)


@pytest.mark.parametrize("text", ["", "xx", "AAAA", "é", pack_mesh(MESH)[:-400], pack_mesh(MESH)[400:]])
def test_damaged_text_is_refused(text: str) -> None:
    """Damaged text is refused with the embedded mesh and a remedy."""
    with pytest.raises(MeshError, match=r"the embedded mesh.*\n.*damaged"):
        unpack_mesh(text)
