# SPDX-License-Identifier: Apache-2.0
"""Collision shapes and pictures of links, and a check that no link is initially inside another body."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.arm import Arm, Visual
from gdfe_ros.arms.description import Description, Geometry
from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.arms.meshes import Surface, convex_pieces
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.form import Form, TriangleMesh, form_faces
from gdfe_ros.constraints.obstacle import ArmLink
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.surfaces.solid import Solid, make_solid

if TYPE_CHECKING:
    from gdfe_ros.constraints.overlap_depths import Placed


def touching_links(
    arm: str,
    robot: Description,
    names: Iterable[str],
    *,
    surfaces: Mapping[str, Surface],
    rest: Mapping[str, LinkFrame],
    friction: float,
) -> tuple[tuple[ArmLink, ...], list[str]]:
    """Return the obstacles of links, named ``<link>_piece``, ``<link>_piece_2`` and so on, and remarks on them.

    Args:
        arm: name of the arm.
        robot: description of the arm.
        names: names of the links that can touch the body.
        surfaces: dict from URI of a mesh to its surface.
        rest: dict from link to its initial frame.
        friction: Coulomb's friction coefficient.

    Raises:
        MeshError: a collision mesh is flat.
    """
    found, remarks = [], []
    for name in names:
        pieces = [piece for shape in robot.links[name].collisions for piece in _forms(name, shape, surfaces, remarks)]
        for number, (form, shape) in enumerate(pieces, start=1):
            frame = rest[name]
            turn = Rotation.from_matrix(frame.axes @ shape.axes).as_rotvec()
            found.append(
                ArmLink(
                    name=f"{name}_piece" + (f"_{number}" if number > 1 else ""),
                    arm=arm,
                    link=name,
                    form=form,
                    origin=tuple((frame.origin + frame.axes @ shape.origin).tolist()),
                    turn=tuple(turn.tolist()),
                    friction=friction,
                )
            )
    return tuple(found), remarks


def _forms(
    link: str, shape: Geometry, surfaces: Mapping[str, Surface], remarks: list[str]
) -> Iterator[tuple[Form, Geometry]]:
    if shape.form is not None:
        yield shape.form, shape
        return
    vertices, triangles = surfaces[shape.file]
    try:
        pieces, debris = convex_pieces((vertices * np.array(shape.scale), triangles))
        if debris:
            remarks.append(f"link {link!r}: {debris} flat pieces of {shape.file} are left out of contact")
        for points, faces in pieces:
            yield TriangleMesh(_solid(points.tobytes(), faces.tobytes())), shape
    except MeshError as error:
        raise MeshError(error.heading, [f"link {link!r}, {shape.file}: {text}" for text in error.defects]) from error


@lru_cache(maxsize=64)
def _solid(points: bytes, faces: bytes) -> Solid:
    """Return the solid of a convex piece. Recent solids are cached, because scenes are often loaded again."""
    vertices, triangles = np.frombuffer(points).reshape(-1, 3), np.frombuffer(faces, dtype=np.int64).reshape(-1, 3)
    return make_solid(vertices, triangles, where="the collision mesh")


def visuals(robot: Description, surfaces: Mapping[str, Surface]) -> tuple[Visual, ...]:
    """Return the drawn shapes of all links, except meshes that are not among the ``surfaces``.

    A link without drawable visual shapes is drawn with its collision shapes.
    """
    found = []
    for name, link in robot.links.items():
        drawn, solid = (
            [shape for shape in shapes if not shape.file or shape.file in surfaces]
            for shapes in (link.visuals, link.collisions)
        )
        for shape in drawn or solid:
            faces = _faces(shape, surfaces) @ shape.axes.T + shape.origin
            found.append(Visual(link=name, faces=faces, colour=shape.colour))
    return tuple(found)


def _faces(shape: Geometry, surfaces: Mapping[str, Surface]) -> np.ndarray:
    if shape.form is not None:
        return form_faces(shape.form)
    vertices, triangles = surfaces[shape.file]
    return (vertices * np.array(shape.scale))[triangles]


TOUCHING = 1e-3
"""Initial penetration up to this depth [m] is allowed, because the meshes of links are not exact."""


def begins_inside(arm: Arm, handles: Sequence[Handle], mesh: HexMesh) -> Iterator[str]:
    """Yield a message with a remedy for each link with contact that is initially inside the body or an obstacle.

    Immovable links are only checked against the soft body, because they may be mounted in an obstacle such as a table.
    """
    if not arm.links:
        return
    from gdfe_ros.constraints.overlap_depths import place_at_rest  # loads numba

    robot = arm.dynamics.description
    surface = mesh.vertices[np.unique(mesh.surface())]
    mounted = robot.rigid_with(robot.root)
    remedy = "remedy: another `start`, another place of the arm (`at`), or leave the link out of `links`"
    things = place_at_rest([each for each in handles if not isinstance(each, ArmLink)])
    for piece in place_at_rest(arm.links):
        depth = -float(piece.measure_points(surface)[0].min(initial=0.0))
        if depth > TOUCHING:
            yield f"link {piece.thing.link!r} begins {depth:.3g} m inside of the soft body; {remedy}"
        for other in things if piece.thing.link not in mounted else ():
            depth = max(_depth(piece, other), _depth(other, piece))
            if depth > TOUCHING:
                where = f"{other.thing.noun} {other.thing.name!r}"
                yield f"link {piece.thing.link!r} begins {depth:.3g} m inside of {where}; {remedy}"


def _depth(one: Placed, other: Placed) -> float:
    """Return the largest depth [m] of surface points of ``one`` obstacle inside the ``other``; 0 if none is inside."""
    return -float(other.measure_points(one.world(one.thing.form.skin))[0].min(initial=0.0))
