# SPDX-License-Identifier: Apache-2.0
"""Checks for scenes that cannot be solved although each value is valid, and remarks on probable mistakes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, Cable, Chamber, Grip, Growth, Mode
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.form import Sphere
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import SceneError
from gdfe_ros.materials import Material, lacks_density
from gdfe_ros.mesh import Mesh, TetMesh
from gdfe_ros.mesh.cells.faces import enclosed_volume
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.meshing.walls import flat_walls
from gdfe_ros.mesh.touching import outline
from gdfe_ros.paper.shape_factor import calibration_remarks
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.settings import Dynamics, Policy, Scheme, SolverSettings

LARGEST_CONTRAST = 1e10
"""Largest ratio of Young's moduli in a body; double precision does not resolve larger ratios. 1e6 is tested."""


def refuse_unsolvable(scene: Scene, settings: SolverSettings) -> None:
    """Raise an error if a scene cannot be solved with these settings.

    A scene from a file was already checked on loading, with the file's settings.

    Raises:
        SceneError: the scene cannot be solved; the error names every reason.
    """
    defects = unsolvable(scene, settings.policy)
    if defects:
        raise SceneError(f"scene {scene.name}", [text for _, text in defects])


def remarks(scene: Scene, policy: Policy) -> list[str]:
    """Return remarks on a scene: unusual materials, unsuitable time schemes, missing contact, cells too coarse."""
    notes = _note_conversions(scene.mesh)
    notes += [f"material {key!r}: {text}" for key, item in scene.materials.items() for text in item.remarks()]
    notes += [f"material {key!r}: {item.caveat}" for key, item in scene.materials.items() if item.caveat]
    notes += [f"arm {arm.name!r}: {text}" for arm in scene.arms for text in arm.remarks]
    if policy is Policy.RELATIVE:
        used = [item for item in scene.materials.values() if item.omega is None]
        notes += calibration_remarks(np.array([item.young0 for item in used])) if used else []
    for item in scene.actuators:
        if isinstance(item, Cable) and item.points.moved:
            text = f"points beside the body were moved onto it, by up to {item.points.moved:.3g} m"
            notes.append(f"actuator {item.name!r}: {text}")
    if scene.dynamics is not None:
        notes += _of_scheme(scene, scene.dynamics.scheme)
    if len(scene.mesh.parts) > 1 and scene.self_contact is None:
        notes.append(f"meshes: they can pass through each other; remedy: {_to_touch(scene.mesh)}")
    return [*notes, *_slipping(scene), *coarse_contacts(scene), *coarse_cavities(scene), *coarse_walls(scene)]


def _of_scheme(scene: Scene, scheme: Scheme) -> list[str]:
    """Return remarks on actuators whose forces oscillate because a time scheme does not damp them."""
    grips = [item.name for item in scene.actuators if isinstance(item, Grip)]
    kept = [item.name for item in scene.actuators if item.constrains and item.name not in grips]
    notes = []
    if grips and scheme is not Scheme.BDF2:
        text = f"the forces of {', '.join(grips)} oscillate with {scheme.value} after a sudden motion"
        notes.append(f"dynamics: {text}; remedy: dynamics.scheme: bdf2")
    if kept and scheme is Scheme.NEWMARK:
        text = (
            "newmark does not damp the force that holds the commanded length or volume of "
            f"{', '.join(kept)}, so that it oscillates"
        )
        notes.append(f"dynamics: {text}; remedy: dynamics.scheme: generalised_alpha, or a cable with a stiffness")
    return notes


LARGEST_RADIUS = 0.2
"""Largest spectral radius of a scheme with which a block without viscosity stood still on a slope, in steps of 2 ms."""


def _slipping(scene: Scene) -> list[str]:
    """Return a list with a remark if a scene has friction, and nothing damps the oscillations of its contacts."""
    dynamics = scene.dynamics
    if dynamics is None or dynamics.radius <= (Dynamics.rho_inf if dynamics.damps else LARGEST_RADIUS):
        return []
    names = [handle.name for handle in scene.handles if isinstance(handle, Obstacle) and handle.friction > 0.0]
    names += ["self_contact"] * (scene.self_contact is not None and scene.self_contact.friction > 0.0)
    if not names:
        return []
    scheme = dynamics.scheme.value
    if dynamics.scheme is Scheme.GENERALISED_ALPHA:
        scheme += f" with rho_inf {dynamics.rho_inf:g}"
    return [
        f"dynamics: the scheme {scheme} does not damp vibrations of contacts, so that objects may slide although the "
        f"friction of {', '.join(names)} should hold them. Measured on a slope of 0.364: a block slid at 22 to 90 mm/s "
        "with friction 0.38 and at 29 mm/s with 0.45, but stood still with bdf2; remedy: dynamics.scheme: bdf2, or "
        "generalised_alpha with rho_inf 0, or dynamics.damping.viscosity"
    ]


def _note_conversions(mesh: Mesh) -> list[str]:
    """Return remarks on contents of mesh files that were left out, and on cells converted to quadratic tetrahedra."""
    notes = []
    for key, each in ({f"meshes: {name}": part.mesh for name, part in mesh.parts.items()} or {"mesh": mesh}).items():
        notes += [f"{key}: {text}" for text in each.remarks]
        if isinstance(each, TetMesh) and each.linear:
            text = "its linear tetrahedra got a node on each edge, because linear ones lock; edges are straight"
            notes.append(f"{key}: {text}")
        if isinstance(each, TetMesh) and each.hexahedra:
            notes.append(
                f"{key}: its {each.hexahedra} hexahedra were divided into {each.n_cells} tetrahedra, because other "
                "meshes have tetrahedra; these are quadratic, so that half as many cells a side are as accurate"
            )
    return notes


def _to_touch(mesh: Mesh) -> str:
    """Return a text with the entries that a scene needs for contact between the parts of its body."""
    steps = ["self_contact: {friction: 0.5}"]
    if _touch_by_cut_faces(mesh):
        steps.append("`skin: {file: ...}` for each mesh with cut cells, whose faces are not on the surface")
    return ", and ".join(steps)


def unsolvable(scene: Scene, policy: Policy) -> list[tuple[tuple[str, ...], str]]:
    """Return the conflicts between the entries of a scene, each as a key path in the scene file and a sentence.

    If ``cell_material`` is empty because of a defect, the ratios of moduli are not checked; the mesh may be None then.
    """
    mesh, moving = scene.mesh, scene.dynamics is not None
    held = {item.name: _note_held(item, scene.handles) for item in scene.actuators}
    cut = cut_key(mesh) if mesh is not None else ()
    found = [
        (("materials",), _contrast(scene.materials, scene.cell_material)),
        (("solver", "policy"), _forces(scene, policy)),
        *((("actuators", name), text) for name, text in held.items()),
        (("dynamics",), lacks_density(scene.materials, "dynamics need") if moving else ""),
        (("dynamics", "scheme"), _ringing(scene)),
        (("bodies",), _inside(scene) if moving else _still(scene)),
        (cut, _beside(scene) if cut else ""),
    ]
    return [(key, text) for key, text in found if text]


def cut_key(mesh: Mesh) -> tuple[str, ...]:
    """Return the key path of the key ``cells`` that selects cut cells in the scene file; empty if no cells are cut.

    If several meshes have cut cells, the path is that of the first one without contact on its skin. If all of them have
    contact on their skins, it is that of the first one.
    """
    if mesh.filling is None:
        return ()
    cut = [name for name, part in mesh.parts.items() if part.mesh.filling is not None]
    bare = [name for name in cut if mesh.parts[name].mesh.touching is None]
    name = next(iter([*bare, *cut]), None)
    return (*(("mesh",) if name is None else ("meshes", name)), "voxels", "cells")


def _contrast(materials: Mapping[str, Material], cell_material: NDArray[np.int32]) -> str:
    """Return a message if the ratio of the materials' moduli is too large; empty if not."""
    names = list(materials)
    moduli = {names[i]: materials[names[i]].young0 for i in np.unique(cell_material)}
    if not moduli:
        return ""
    soft, hard = min(moduli, key=moduli.__getitem__), max(moduli, key=moduli.__getitem__)
    if moduli[hard] <= LARGEST_CONTRAST * moduli[soft]:
        return ""
    return (
        f"material {hard!r} is {moduli[hard] / moduli[soft]:.3g} times as stiff at rest as {soft!r}; allowed: "
        f"up to {LARGEST_CONTRAST:g}; remedy: make it a handle, which is rigid, or check the units (Pa)"
    )


def _forces(scene: Scene, policy: Policy) -> str:
    """Return a message about items that the policy ``relative`` does not support; empty with the policy ``energy``."""
    if policy is Policy.ENERGY:
        return ""
    names = [item.name for item in scene.actuators if not isinstance(item, Growth)]
    names += [load.name for load in scene.loads]
    names += [handle.name for handle in scene.handles if handle.turning or isinstance(handle, Obstacle)]
    names += ["self_contact"] * (scene.self_contact is not None)
    names += [f"compliance of {arm.name}" for arm in scene.arms if arm.springs is not None]
    names += ["fibres"] * bool(scene.fibres) + ["dynamics"] * (scene.dynamics is not None)
    names += ["tetrahedra"] * isinstance(scene.mesh, TetMesh)
    names += ["cut cells"] * (scene.mesh is not None and scene.mesh.filling is not None)
    if not names:
        return ""
    text = f"the policy 'relative' has no forces and only whole hexahedra; it cannot take {', '.join(names)}"
    return f"{text}; remedy: policy: energy (growth works in both)"


def _ringing(scene: Scene) -> str:
    """Return a message about grips in a motion by `Scheme.NEWMARK`; empty if there are none."""
    names = [item.name for item in scene.actuators if isinstance(item, Grip)]
    if not names or scene.dynamics is None or not scene.dynamics.undamped:
        return ""
    text = f"newmark does not damp the oscillating forces of grips: {', '.join(names)}"
    return f"{text}; what they let go of would jump by some per cent of its momentum; remedy: bdf2"


def _still(scene: Scene) -> str:
    """Return a message about rigid bodies, which cannot move without dynamics; empty if there are none."""
    names = ", ".join(repr(body.name) for body in scene.rigid_bodies)
    if not names:
        return ""
    return f"{names} cannot move without dynamics; remedy: add `dynamics: {{}}`, or make it one of the `obstacles`"


def _inside(scene: Scene) -> str:
    """Return a message about rigid bodies that are initially inside another rigid body, an obstacle or the soft body.

    It is empty if there are none.
    """
    if not scene.rigid_bodies:
        return ""
    from gdfe_ros.constraints.overlap_depths import inside_surface, overlaps, place_at_rest  # loads numba

    placed, mesh = place_at_rest(scene.handles), scene.mesh
    found = list(overlaps(placed))
    if mesh is not None:
        rigid = [one for one in placed if isinstance(one.thing, RigidBody)]
        surface = outline(flat_quads(mesh.boundary.quads), mesh.touching, mesh.vertices)
        found += [inside_surface(one, *surface) for one in rigid]
    return "; ".join(text for text in found if text)


def _beside(scene: Scene) -> str:
    """Return a message about items that act on the faces of cut cells, which are not on the surface; empty if none."""
    bare = _touch_by_cut_faces(scene.mesh)
    names = [item.name for item in scene.actuators if isinstance(item, Chamber) and item.points is None]
    touched = [handle.name for handle in scene.handles if bare and isinstance(handle, Obstacle)]
    touched += ["self_contact"] * (bare and scene.self_contact is not None)
    names += touched
    if not names:
        return ""
    text = f"{', '.join(names)} would act on the faces of cut cells, up to a cell outside of the surface"
    if touched:
        return (
            f"{text}; remedy: `skin: {{file: ...}}` with the mesh's closed surface, which then touches, or cells: whole"
        )
    return f"{text}; remedy: cells: whole"


def _touch_by_cut_faces(mesh: Mesh) -> bool:
    """Return whether a mesh, or one of the meshes of an assembly, has cut cells but no contact on a skin."""
    meshes = [part.mesh for part in mesh.parts.values()] or [mesh]
    return any(each.filling is not None and each.touching is None for each in meshes)


def _note_held(actuator: Actuator, handles: Sequence[Handle]) -> str:
    """Return a message if a commanded length or volume cannot change: all vertices of the actuator are in handles.

    Handles with free axes do not count. The message is empty if a vertex can move.
    """
    if isinstance(actuator, Cable) and actuator.mode is not Mode.TENSION:
        vertices = actuator.points.corners[actuator.points.weights != 0.0]
    elif isinstance(actuator, Chamber) and actuator.mode is not Mode.PRESSURE:
        vertices = actuator.vertices
    else:
        return ""
    stiff = [handle for handle in handles if not handle.loose]
    held = np.concatenate([np.zeros(0, np.int32), *(handle.vertices for handle in stiff)])
    if not np.isin(vertices, held).all():
        return ""
    names = ", ".join(repr(handle.name) for handle in stiff if np.isin(vertices, handle.vertices).any())
    return (
        f"actuator {actuator.name!r} lies wholly inside of {names}, and cannot change its {actuator.mode.value}; "
        "remedy: route it through cells that can deform, or command a force"
    )


LEAST_CELLS = 3.0
"""A remark is given if a ball's radius, divided by the size of the cells, is below this. At this ratio, and at an
indentation of a tenth of the radius, the error of the contact force is at most 8 %.
"""
RADIUS_ROUNDING = 1e-9
"""Relative tolerance for rounding errors when a ball's radius is compared with the size of the cells."""
THICKEST_CELL = 0.35
"""A remark is given if the thickness of a cell in the wall of a round cavity, divided by the radius of the cavity,
exceeds this. The error of the volume is then above 5 %.
"""
ROUND = 1.1
"""A cavity counts as round if its area is at most this multiple of the area of a ball with the same volume; a cube has
1.24.
"""


def coarse_contacts(scene: Scene) -> list[str]:
    """Return remarks on balls whose radius is too small compared with the size of the body's boundary faces."""
    balls = [handle for handle in scene.handles if isinstance(handle, Obstacle) and isinstance(handle.form, Sphere)]
    if not balls:
        return []
    cell = float(np.sqrt(np.median(corner_areas(scene.mesh.vertices, scene.mesh.boundary.quads).sum(axis=1))))
    return [
        f"{ball.section} {ball.name!r}: its radius {ball.form.radius:.3g} m is only {ball.form.radius / cell:.2g} "
        f"times the size of the cells that it can touch ({cell:.3g} m). Measured for a ball pressed in by a tenth "
        "of its radius: with a radius of 3 cells the force was right within 8 %; with 2 cells it was 48 % too "
        "small to 17 % too large, depending on the position between the cells; with 1 cell it fell to zero; "
        f"remedy: cells of at most a third of the radius, {ball.form.radius / LEAST_CELLS:.2g} m"
        for ball in balls
        if ball.form.radius < (1.0 - RADIUS_ROUNDING) * LEAST_CELLS * cell
    ]


def coarse_cavities(scene: Scene) -> list[str]:
    """Return remarks on round chambers whose wall has too few cells through its thickness."""
    found = []
    for chamber in scene.actuators:
        if not isinstance(chamber, Chamber) or chamber.points is not None or scene.mesh.nodes != 8:
            continue
        vertices = scene.mesh.vertices
        volume = abs(enclosed_volume(vertices, chamber.quads))
        area = float(corner_areas(vertices, chamber.quads).sum())
        radius = 3.0 * volume / area
        if area > ROUND * (36.0 * np.pi * volume**2) ** (1.0 / 3.0):
            continue
        thick = _depth(scene, chamber) / radius
        if thick > THICKEST_CELL:
            found.append(
                f"actuators {chamber.name!r}: the cells around it are {thick:.2g} of its radius thick, which makes "
                "it too stiff. Compared with Lame's solution, a ball under pressure opened 6 % too little with "
                f"cells of 0.43 of the radius, 9 % with 0.5 and 24 % with 1; remedy: {int(np.ceil(thick / 0.25))} "
                "times as many cells across the wall"
            )
    return found


def coarse_walls(scene: Scene) -> list[str]:
    """Return remarks on walls of tetrahedra whose cells are too long for the thickness of the wall."""
    mesh = scene.mesh
    return [f"mesh: {text}" for text in flat_walls(mesh)] if isinstance(mesh, TetMesh) else []


def _depth(scene: Scene, chamber: Chamber) -> float:
    """Return the mean thickness [m] of the cells with a face in a chamber, from this face to the opposite face."""
    inner = np.isin(scene.mesh.cells, chamber.quads)
    behind = inner.sum(axis=1) == 4
    corners, near = scene.mesh.vertices[scene.mesh.cells[behind]], inner[behind, :, None]
    through = 0.25 * (np.where(near, 0.0, corners) - np.where(near, corners, 0.0)).sum(axis=1)
    return float(np.linalg.norm(through, axis=1).mean())
