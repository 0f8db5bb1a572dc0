# SPDX-License-Identifier: Apache-2.0
"""Checks for scenes that cannot be solved although each of their values is valid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, Cable, Chamber, Grip, Growth, Load, Mode
from gdfe_ros.arms.arm import Arm
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody, rigid_among
from gdfe_ros.constraints.self_contact import SelfContact
from gdfe_ros.errors import SceneError
from gdfe_ros.materials import Material, lacks_density
from gdfe_ros.materials.fibre_layer import FibreLayer
from gdfe_ros.mesh import Mesh, TetMesh
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.mesh.touching import outline
from gdfe_ros.paper.shape_factor import calibration_remarks
from gdfe_ros.scene.resolution import coarse_cavities, coarse_contacts, coarse_walls
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.sticking import slipping
from gdfe_ros.solver.motion.dynamics import Dynamics, Scheme
from gdfe_ros.solver.settings import Policy, SolverSettings

LARGEST_CONTRAST = 1e10
"""Largest ratio of Young's moduli in a body; double precision does not resolve larger ratios. 1e6 is tested."""


def refuse_unsolvable(scene: Scene, settings: SolverSettings) -> None:
    """Raise an error if a scene cannot be solved with these settings.

    A scene from a file was already checked on loading, with the file's settings.

    Raises:
        SceneError: the scene cannot be solved; the error names every reason.
    """
    defects = unsolvable(
        materials=scene.materials,
        cell_material=scene.cell_material,
        handles=scene.handles,
        actuators=scene.actuators,
        loads=scene.loads,
        dynamics=scene.dynamics,
        self_contact=scene.self_contact,
        policy=settings.policy,
        mesh=scene.mesh,
        cut=cut_key(scene.mesh),
        fibres=scene.fibres,
        arms=scene.arms,
    )
    if defects:
        raise SceneError(f"scene {scene.name}", [text for _, text in defects])


def remarks(scene: Scene, policy: Policy) -> list[str]:
    """Return remarks on a scene: unusual materials, unsuitable time schemes, missing contact, cells too coarse."""
    notes = _converted(scene.mesh)
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
    return [*notes, *slipping(scene), *coarse_contacts(scene), *coarse_cavities(scene), *coarse_walls(scene)]


def _of_scheme(scene: Scene, scheme: Scheme) -> list[str]:
    """Return remarks on what a time scheme does not damp."""
    rigid = [body.name for body in scene.rigid_bodies]
    grips = [item.name for item in scene.actuators if isinstance(item, Grip)]
    kept = [item.name for item in scene.actuators if item.constrains and item.name not in grips]
    notes = []
    if len(rigid) > 1 and scheme is not Scheme.BDF2:
        text = f"{', '.join(rigid)} may not come to rest on each other with {scheme.value}"
        notes.append(f"bodies: {text}; remedy: dynamics.scheme: bdf2")
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


def _converted(mesh: Mesh) -> list[str]:
    """Return remarks on meshes whose files were not read wholly, or whose cells became quadratic tetrahedra."""
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
    """Return a text with the changes of a scene file after which the parts of a body touch each other."""
    steps = ["self_contact: {friction: 0.5}"]
    if _touch_by_cut_faces(mesh):
        steps.append("`skin: {file: ...}` for each mesh with cut cells, whose faces are not on the surface")
    return ", and ".join(steps)


def unsolvable(
    *,
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    handles: Sequence[Handle],
    actuators: Sequence[Actuator],
    loads: Sequence[Load],
    dynamics: Dynamics | None,
    policy: Policy,
    self_contact: SelfContact | None = None,
    mesh: Mesh | None = None,
    cut: tuple[str, ...] = (),
    fibres: Sequence[FibreLayer] = (),
    arms: Sequence[Arm] = (),
) -> list[tuple[tuple[str, ...], str]]:
    """Return the conflicts between the entries of a scene, each as a key path in the scene file and a sentence.

    ``cell_material`` (m,) are the indices of the cells' materials. If it is empty because of a defect, the ratios of
    moduli are not checked. ``mesh`` is the body, None if it has defects. ``cut`` is the result of `cut_key`.
    """
    held = {item.name: _held(item, handles) for item in actuators}
    found = [
        (("materials",), _contrast(materials, cell_material)),
        (("solver", "policy"), _forces(handles, actuators, loads, self_contact, arms, policy)),
        *((("actuators", name), text) for name, text in held.items()),
        (("fibres",), _stiffened(fibres, policy)),
        (("dynamics",), _inertia(materials, policy) if dynamics is not None else ""),
        (("dynamics", "scheme"), _ringing(actuators, dynamics)),
        (("bodies",), _still(handles) if dynamics is None else _inside(handles, mesh)),
        (cut, _beside(handles, actuators, self_contact, policy, mesh) if cut else ""),
        (("mesh",), _tetrahedra(mesh, policy)),
    ]
    return [(key, text) for key, text in found if text]


def _stiffened(fibres: Sequence[FibreLayer], policy: Policy) -> str:
    """Return a message about fibres with a policy that has no forces; empty if there are none."""
    if not fibres or policy is Policy.ENERGY:
        return ""
    return f"the policy {policy.value!r} has no forces, and thus no fibres; remedy: solver.policy: energy"


def _tetrahedra(mesh: Mesh | None, policy: Policy) -> str:
    """Return a message about items that bodies of tetrahedra do not support; empty if there are none."""
    if not isinstance(mesh, TetMesh):
        return ""
    lacking = [f"policy {policy.value!r}"] * (policy is not Policy.ENERGY)
    if mesh.skin is not None:
        lacking += ["skin"]
    if not lacking:
        return ""
    return f"a body of tetrahedra cannot have {', '.join(lacking)} yet; remedy: leave it out, or use voxels"


def cut_key(mesh: Mesh) -> tuple[str, ...]:
    """Return the key path of the key ``cells`` that selects cut cells in the scene file; empty if no cells are cut.

    Of several meshes with cut cells, the path is that of the first mesh whose skin does not touch, or else of the first
    mesh.
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
    moduli = {names[i]: materials[names[i]].young0 for i in np.unique(cell_material) if names[i] in materials}
    if not moduli:
        return ""
    soft, hard = min(moduli, key=moduli.__getitem__), max(moduli, key=moduli.__getitem__)
    if moduli[hard] <= LARGEST_CONTRAST * moduli[soft]:
        return ""
    return (
        f"material {hard!r} is {moduli[hard] / moduli[soft]:.3g} times as stiff at rest as {soft!r}; allowed: "
        f"up to {LARGEST_CONTRAST:g}; remedy: make it a handle, which is rigid, or check the units (Pa)"
    )


def _forces(
    handles: Sequence[Handle],
    actuators: Sequence[Actuator],
    loads: Sequence[Load],
    self_contact: SelfContact | None,
    arms: Sequence[Arm],
    policy: Policy,
) -> str:
    """Return a message about items that need forces if the policy is ``relative``, which has no forces; else empty."""
    if policy is Policy.ENERGY:
        return ""
    names = [item.name for item in actuators if not isinstance(item, Growth)]
    names += [load.name for load in loads]
    names += [handle.name for handle in handles if handle.turning or isinstance(handle, Obstacle)]
    names += ["self_contact"] * (self_contact is not None)
    names += [f"compliance of {arm.name}" for arm in arms if arm.springs is not None]
    if not names:
        return ""
    text = f"the policy 'relative' has no forces and cannot take {', '.join(names)}"
    return f"{text}; remedy: policy: energy (growth works in both)"


def _ringing(actuators: Sequence[Actuator], dynamics: Dynamics | None) -> str:
    """Return a message about grips in a motion by `Scheme.NEWMARK`; empty if there are none."""
    names = [item.name for item in actuators if isinstance(item, Grip)]
    if not names or dynamics is None or dynamics.scheme is not Scheme.NEWMARK:
        return ""
    text = f"newmark does not damp the oscillating forces of grips: {', '.join(names)}"
    return f"{text}; what they let go of would jump by some per cent of its momentum; remedy: bdf2"


def _inertia(materials: Mapping[str, Material], policy: Policy) -> str:
    """Return a message if dynamics are impossible with the policy or without a density; empty if they are possible."""
    if policy is not Policy.ENERGY:
        return "the policy 'relative' has no forces and finds equilibria only; remedy: policy: energy"
    return lacks_density(materials, "dynamics need")


def _still(handles: Sequence[Handle]) -> str:
    """Return a message about rigid bodies, which cannot move without dynamics; empty if there are none."""
    names = ", ".join(repr(body.name) for body in rigid_among(handles))
    if not names:
        return ""
    return f"{names} cannot move without dynamics; remedy: add `dynamics: {{}}`, or make it one of the `obstacles`"


def _inside(handles: Sequence[Handle], mesh: Mesh | None) -> str:
    """Return a message about rigid bodies that are initially inside another rigid body, an obstacle or the soft body.

    It is empty if there are none.
    """
    if not rigid_among(handles):
        return ""
    from gdfe_ros.solver.contact.overlap import inside_surface, overlaps, placed_at_rest  # loads numba

    placed = placed_at_rest(handles)
    found = list(overlaps(placed))
    if mesh is not None:
        rigid = [one for one in placed if isinstance(one.thing, RigidBody)]
        surface = outline(flat_quads(mesh.boundary.quads), mesh.touching, mesh.vertices)
        found += [inside_surface(one, *surface) for one in rigid]
    return "; ".join(text for text in found if text)


def _beside(
    handles: Sequence[Handle],
    actuators: Sequence[Actuator],
    self_contact: SelfContact | None,
    policy: Policy,
    mesh: Mesh | None,
) -> str:
    """Return a message about items that act on the faces of cut cells, which are not on the surface; empty if none."""
    if policy is not Policy.ENERGY:
        return "the policy 'relative' does not weight cells that are cut; remedy: cells: whole, or policy: energy"
    bare = _touch_by_cut_faces(mesh)
    names = [item.name for item in actuators if isinstance(item, Chamber) and item.points is None]
    touched = [handle.name for handle in handles if bare and isinstance(handle, Obstacle)]
    touched += ["self_contact"] * (bare and self_contact is not None)
    names += touched
    if not names:
        return ""
    text = f"{', '.join(names)} would act on the faces of cut cells, up to a cell outside of the surface"
    if touched:
        return (
            f"{text}; remedy: `skin: {{file: ...}}` with the mesh's closed surface, which then touches, or cells: whole"
        )
    return f"{text}; remedy: cells: whole"


def _touch_by_cut_faces(mesh: Mesh | None) -> bool:
    """Return whether a mesh, or a mesh of an assembly, has cut cells and no skin that touches instead of its faces."""
    if mesh is None:
        return False
    meshes = [part.mesh for part in mesh.parts.values()] or [mesh]
    return any(each.filling is not None and each.touching is None for each in meshes)


def _held(actuator: Actuator, handles: Sequence[Handle]) -> str:
    """Return a message if all vertices of a cable or chamber with a commanded length or volume are in fixed handles.

    Handles without free axes count as fixed. The message is empty if a vertex can move.
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
