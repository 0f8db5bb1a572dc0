# SPDX-License-Identifier: Apache-2.0
"""Thin layers of fibres on the surface of a body: hoops, braids, strain-limiting sheets."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.mesh.cells.face_fibres import FibrePoints


@dataclass(frozen=True, eq=False, kw_only=True)
class FibreLayer:
    """A layer without thickness and without resistance to bending.

    Its energy is the sum over its families of fibres of the integral of k/2 e^2 over the undeformed area, with the
    Green strain e = (lambda^2 - 1) / 2 and the stretch lambda of the fibre.

    Attributes:
        name: name, unique among the actuators, loads and layers of the scene.
        stiffness: k [N/m] of each family: force per width and strain, i.e. Young's modulus times thickness.
        compression: whether the fibres also resist compression; otherwise they are slack for e < 0.
        families: integration points of each family of parallel fibres.
    """

    name: str
    stiffness: float
    compression: bool
    families: tuple[FibrePoints, ...]
