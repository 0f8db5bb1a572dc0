# SPDX-License-Identifier: Apache-2.0
"""Shapes of links: convex obstacles from collision shapes, and drawn faces from visual shapes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from gdfe_ros.arms.arm import Visual
from gdfe_ros.arms.description import Description, Geometry, GeometryKind
from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.arms.meshes import Surface, convex_pieces
from gdfe_ros.constraints.arm_link import ArmLink
from gdfe_ros.constraints.form import Box, Cylinder, Form, Sphere, TriangleMesh
from gdfe_ros.constraints.form_faces import form_faces
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.solid import Solid, make_solid


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
    match shape.kind:
        case GeometryKind.BOX:
            yield Box(shape.numbers), shape
        case GeometryKind.CYLINDER:
            yield Cylinder(*shape.numbers), shape
        case GeometryKind.SPHERE:
            yield Sphere(*shape.numbers), shape
        case GeometryKind.MESH:
            vertices, triangles = surfaces[shape.file]
            try:
                pieces, debris = convex_pieces((vertices * np.array(shape.numbers), triangles))
                if debris:
                    remarks.append(f"link {link!r}: {debris} flat pieces of {shape.file} are left out of contact")
                for points, faces in pieces:
                    yield TriangleMesh(_solid(points.tobytes(), faces.tobytes())), shape
            except MeshError as error:
                raise MeshError(
                    error.heading, [f"link {link!r}, {shape.file}: {text}" for text in error.defects]
                ) from error


@lru_cache(maxsize=64)
def _solid(points: bytes, faces: bytes) -> Solid:
    """Return the solid of a convex piece. Recent solids are cached, because scenes are often loaded again."""
    vertices, triangles = np.frombuffer(points).reshape(-1, 3), np.frombuffer(faces, dtype=np.int64).reshape(-1, 3)
    return make_solid(vertices, triangles, where="the collision mesh")


def visuals(robot: Description, surfaces: Mapping[str, Surface]) -> tuple[Visual, ...]:
    """Return the drawn shapes of all links, except meshes that are not among the ``surfaces``.

    A link without visual shapes, or with none that is left, is drawn with its collision shapes.
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
    match shape.kind:
        case GeometryKind.BOX:
            return form_faces(Box(shape.numbers))
        case GeometryKind.CYLINDER:
            return form_faces(Cylinder(*shape.numbers))
        case GeometryKind.SPHERE:
            return form_faces(Sphere(*shape.numbers))
        case GeometryKind.MESH:
            vertices, triangles = surfaces[shape.file]
            return (vertices * np.array(shape.numbers))[triangles]
