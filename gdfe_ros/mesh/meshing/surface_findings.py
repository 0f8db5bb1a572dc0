# SPDX-License-Identifier: Apache-2.0
"""Checks of a surface before it is filled with cells: winding, self-intersections, thin walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import show_point
from gdfe_ros.mesh.contact_skin import out_of_material
from gdfe_ros.mesh.files.mesher_process import MOST_CELLS, estimate_cells
from gdfe_ros.mesh.meshing.walls import (
    FLATTEST,
    LEAST_FRACTION,
    Walls,
    cells_at_walls,
    find_solid_walls,
    find_walls,
    show_error,
)
from gdfe_ros.mesh.overlap import SelfCuts, find_self_cuts
from gdfe_ros.mesh.surfaces.shells import cone_volumes, doubled_areas, shell_numbers
from gdfe_ros.mesh.surfaces.surface_edges import disagreeing_edges, is_closed, odd_edges, winding_defects

ACROSS = 4
"""Number of hexahedra across the thinnest part. A clamped bar of four hexahedra across is 1.4 % too stiff."""
COST = 2.0
"""Computing time of a second-order tetrahedron divided by that of a hexahedron (docs/choose.md)."""
CHEAPER = 4.0
"""Hexahedra are recommended if tetrahedra cost at least this many times as much."""
FLAT = 1e-6
"""Rounding tolerance: components of unit normals below this count as zero, and planes coincide if their distance
divided by the body's size is below this.
"""


def cheaper_hexahedra(
    vertices: NDArray[np.float64], triangles: NDArray[np.integer], *, tetrahedra: float, thinnest: float
) -> list[str]:
    """Return a list with a remark if regular hexahedra fill a body at a fraction of the cost; empty if not.

    A body qualifies in three cases: it is a box; all its faces are parallel to the planes of the axes; or it is
    extruded along an axis. Each face of an extruded body is parallel to the axis, or lies in one of two planes across
    it.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids of the closed surface, shape (t, 3).
        tetrahedra: number of tetrahedra, or their expected number.
        thinnest: least thickness of a wall [m].
    """
    corners = vertices[triangles]
    areas, lengths = doubled_areas(corners)
    solid = lengths > 0.0
    corners, normals = corners[solid], np.abs(areas[solid] / lengths[solid, None])
    volume = abs(float(cone_volumes(vertices, triangles).sum()))
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    edge = thinnest / ACROSS
    if not np.isfinite(edge) or not edge > 0.0 or COST * tetrahedra < CHEAPER * volume / edge**3:
        return []
    shape, remedy = _shape(corners, normals, high - low, volume, edge)
    if not shape:
        return []
    ratio = COST * tetrahedra / (volume / edge**3)
    return [
        f"the body is {shape}. With {ACROSS} hexahedra across its thinnest part, a step would cost about {ratio:.0f} "
        f"times less than with {tetrahedra:.0f} tetrahedra; a clamped bar is 1.4 % too stiff then; remedy: {remedy}"
    ]


def _shape(
    corners: NDArray[np.float64], normals: NDArray[np.float64], extent: NDArray[np.float64], volume: float, edge: float
) -> tuple[str, str]:
    """Return the description of a box-like or extruded shape and how to mesh it; two empty texts for other shapes."""
    size = ", ".join(f"{length:.4g}" for length in extent)
    cells = ", ".join(str(max(1, round(length / edge))) for length in extent)
    bar = f"`mesh: {{bar: {{size: [{size}], cells: [{cells}]}}}}`"
    if (normals.max(axis=1) > 1.0 - FLAT).all():
        if volume > (1.0 - FLAT) * extent.prod():
            return "a box", bar
        return "bounded by planes across the axes", f"{bar} with the missing boxes in `cut`"
    for axis, name in enumerate("xyz"):
        along, across = normals[:, axis] < FLAT, normals[:, axis] > 1.0 - FLAT
        planes = corners[across, :, axis]
        ends = np.minimum(np.abs(planes - corners[..., axis].min()), np.abs(planes - corners[..., axis].max()))
        if (along | across).all() and ends.max(initial=0.0) < FLAT * extent.max():
            return f"extruded along {name}", (
                "quadrilaterals in its profile, extruded into hexahedra (gmsh: Recombine Surface, Extrude with "
                "Layers), as `mesh: {file: ...}`"
            )
    return "", ""


FACETED = 1e-4
"""Largest allowed overlap of a STEP file's facets, divided by the diagonal of the surface; facets are approximate."""
OUTWARD, INWARD = "out of the material", "into the material"


@dataclass(frozen=True, eq=False)
class SurfaceFindings:
    """The findings on a surface that is to be filled with cells.

    Attributes:
        vertices: (n, 3) [m].
        triangles: (t, 3) vertex ids.
        size: size of the cells [m] with which walls are compared.
        cuts: self-intersections.
        walls: thickness of the walls; None if the material is not known, because the surface is open, cuts itself, or
            has neighbours that are wound in opposite directions.
        normals: direction of the normals in words.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    size: float
    cuts: SelfCuts
    walls: Walls | None
    normals: str = "unknown"

    @property
    def wrong_edges(self) -> NDArray[np.float64]:
        """Ends (k, 2, 3) [m] of the edges that are open, or whose triangles are wound in opposite directions."""
        wrong = np.concatenate([odd_edges(self.triangles), disagreeing_edges(self.triangles)])
        return self.vertices[wrong]

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Pairs (name, value) of texts, for a table."""
        found = [("pairs of triangles that cut each other", str(self.cuts.pairs)), ("normals", self.normals)]
        if self.walls is None:
            return [*found, ("walls", "unknown, because the surface is not closed, not wound alike, or cuts itself")]
        thickness = self.walls.thickness
        worst = self.walls.thinnest
        if np.isfinite(thickness[worst]):
            place = show_point(self.walls.places[worst])
            found.append(("thinnest wall", f"{thickness[worst]:.3g} m near {place} m"))
        name = f"surface at walls thinner than {self.size:.3g} m"
        return [*found, (name, f"{self.walls.fraction(thickness < self.size):.1%}")]

    @property
    def defects(self) -> list[str]:
        """Texts of the defects: neighbours that are wound in opposite directions, self-intersections, thin walls.

        Thin walls are a defect if cells of their thickness would be too many for a mesh.
        """
        found = winding_defects(self.vertices, self.triangles) + self.cuts.defects
        if self._has_thin_walls and self._cells > MOST_CELLS:
            place = show_point(self.walls.places[self.walls.thinnest])
            found.append(
                f"walls are too thin for cells of any size, the thinnest {self._thinnest:.3g} m near {place} m. Cells "
                f"as small as that would be about {self._cells:.2g} tetrahedra; allowed: up to {MOST_CELLS:g}; remedy: "
                "thicker walls, or check the unit"
            )
        return found

    @property
    def remarks(self) -> list[str]:
        """Advice on normals that point into the material, on walls too thin for the cells, on cheaper hexahedra."""
        found = []
        if self.normals == INWARD:
            found.append(
                "the normals point into the material. A body is filled all the same, but `obstacles` and `bodies` "
                "refuse this surface; remedy: turn it (MeshLab: Invert Faces Orientation, Blender: Recalculate Outside)"
            )
        if self._has_thin_walls and self._cells <= MOST_CELLS:
            found.append(
                f"{self._thin_fraction:.0%} of the surface is at walls that are thin for cells of {self.size:.3g} m. "
                f"{show_error(self.size / self._thinnest)}; remedy: for tetrahedra `least_size: {self._thinnest:.2g}` "
                "beside `size`, which makes small cells only at thin walls; for voxels a `cell` of at most "
                f"{0.5 * self._thinnest:.2g} m"
            )
        if self.walls is not None:
            volume = abs(float(cone_volumes(self.vertices, self.triangles).sum()))
            expected = float(estimate_cells(volume, self.size))
            found += cheaper_hexahedra(self.vertices, self.triangles, tetrahedra=expected, thinnest=self._thinnest)
        return found

    @property
    def _thin_fraction(self) -> float:
        """Fraction of the surface at walls that are too thin for cells of `size`."""
        return self.walls.fraction(self.size / self.walls.thickness > FLATTEST)

    @property
    def _has_thin_walls(self) -> bool:
        return self.walls is not None and self._thin_fraction >= LEAST_FRACTION

    @property
    def _thinnest(self) -> float:
        """Least thickness of a wall [m]."""
        return float(self.walls.thickness.min())

    @property
    def _cells(self) -> float:
        """Expected number of tetrahedra if ``least_size`` is the thickness of the thinnest wall."""
        return cells_at_walls(self.walls, size=self.size, least_size=self._thinnest)


def surface_findings(vertices: NDArray[np.float64], triangles: NDArray[np.int64], *, size: float) -> SurfaceFindings:
    """Examine a surface (n, 3) [m] of triangles (t, 3); its walls are compared with cells of ``size`` [m]."""
    cuts = find_self_cuts(vertices, triangles)
    if cuts.pairs or not is_closed(triangles):
        return SurfaceFindings(vertices, triangles, size, cuts, None)
    outward = out_of_material(vertices, triangles)
    walls = find_walls(vertices, outward, spacing=size)
    return SurfaceFindings(vertices, triangles, size, cuts, walls, _normals(vertices, triangles, outward))


def solid_findings(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], solid: NDArray[np.int64], *, size: float
) -> SurfaceFindings:
    """Examine the facets of a STEP file's solids, as `tetrahedralise.step_surface` returns them."""
    _, once = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    walls = find_solid_walls(vertices, triangles, solid, spacing=size)
    cuts = find_self_cuts(vertices, triangles[once], touch=FACETED)
    return SurfaceFindings(vertices, triangles[once], size, cuts, walls, OUTWARD)


def _normals(vertices: NDArray[np.float64], triangles: NDArray[np.int64], outward: NDArray[np.int64]) -> str:
    """Return the direction of a closed surface's normals; ``outward`` are the triangles with outward normals."""
    shell = shell_numbers(len(vertices), triangles)
    turned, count = len(np.unique(shell[(outward != triangles).any(axis=1)])), int(shell.max()) + 1
    if turned in (0, count):
        return INWARD if turned else OUTWARD
    return f"{OUTWARD}, except in {turned} of {count} shells"
