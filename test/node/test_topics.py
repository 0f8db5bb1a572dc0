# SPDX-License-Identifier: Apache-2.0
"""A second process commands the node over topics and receives the mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def test_the_mesh_follows_the_commands(client: Any, start: Callable, coarse: dict) -> None:
    """A tip lifted by 0.1 m is seen in vertices, pose, wrench, strain and topology."""
    start(**coarse)
    client.target(0.1)
    client.wait(lambda: np.isclose(client.mesh()[:, 5].max(), 0.1, atol=1e-6))
    mesh, stamp = client.mesh(), client.last("mesh").header.stamp
    assert mesh.shape == (21 * 9, 6)
    np.testing.assert_allclose(mesh[:21, 0] - mesh[:21, 3], np.linspace(0, 0.5, 21), atol=1e-6)
    assert client.arrived("handles/tip/pose", stamp).pose.position.z == 0.1
    assert client.arrived("handles/tip/wrench", stamp).wrench.force.z > 0.0
    strain = client.arrived("strain", stamp)
    assert [field.name for field in strain.fields][3:] == ["eps_eq", "J", "omega", "tangent", "energy_density"]
    assert np.frombuffer(strain.data, "<f4").reshape(-1, 8)[:, 3].max() > 1e-3
    topology = client.last("topology")
    assert [dimension.size for dimension in topology.layout.dim] == [80, 8]
    assert max(topology.data) == 21 * 9 - 1
    assert client.last("mesh").header.frame_id == "base_link"


def test_a_handle_turns_on_and_on(client: Any, start: Callable, coarse: dict) -> None:
    """Commanded quaternions of a growing angle give targets that pass half a turn without a jump."""
    start(**{**coarse, "scene": "twist90", "clock": "lockstep"})
    for angle in np.arange(0.5, 4.6, 0.5):
        client.target(turn=(angle, 0, 0))
    client.wait(lambda: len(client.records()) >= 10)
    turns = [record.handles["tip"].rotation[0] for record in client.records()[1:]]
    np.testing.assert_allclose(turns, np.arange(0.5, 4.6, 0.5), atol=1e-12)
