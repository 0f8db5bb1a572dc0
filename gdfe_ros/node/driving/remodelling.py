# SPDX-License-Identifier: Apache-2.0
"""Replacement of a running simulation by one with other Young's moduli, or with other free bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import GdfeError, OverlapError
from gdfe_ros.materials import Linear, NeoHookean
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.node.driving.carry import Correspondence, carry_motion, match_loose, match_vertices, with_bodies_of
from gdfe_ros.node.interface import MODULUS
from gdfe_ros.scene.building.soft_bodies import parts_of
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.simulation_parts.rigid_places import put_rigid, release
from gdfe_ros.simulation_parts.soft_places import require_soft_free

_LONG = 1e9
"""Duration of a step [s] so long that no rate limit restricts a command."""


def moduli_of(scene: Scene) -> dict[str, float]:
    """Return a dict from material name to Young's modulus [Pa], for linear and neo-Hookean materials."""
    found = scene.materials.items()
    return {name: material.young for name, material in found if isinstance(material, (Linear, NeoHookean))}


def source_with(scene: Scene, moduli: Mapping[str, float]) -> str:
    """Return the YAML text of a scene with other Young's ``moduli`` [Pa]; materials without a modulus are ignored."""
    known = moduli_of(scene)
    return _with(scene, {name: young for name, young in moduli.items() if name in known}).source


def _with(scene: Scene, moduli: Mapping[str, float]) -> Scene:
    overrides = {MODULUS.name.format(material=name): young for name, young in moduli.items()}
    return scene_from_text(scene.source, origin=scene.name, overrides=overrides)


def build_simulation(scene: Scene) -> Simulation:
    """Return a simulation of a scene with factored matrices and compiled kernels; it takes long."""
    simulation = Simulation(scene)
    simulation.warm_up()
    return simulation


def with_moduli(
    old: Simulation, moduli: Mapping[str, float], *, interrupted: Callable[[], bool] | None = None
) -> Simulation:
    """Return a new simulation with other moduli.

    Without dynamics, it is solved at the present commands. With dynamics, it continues the present motion.

    Args:
        old: present simulation; it is not changed.
        moduli: Young's modulus [Pa] of each material that changes.
        interrupted: function that is called repeatedly. If it returns True, the solve for the new equilibrium ends
            early.

    Raises:
        GdfeError: without dynamics, a grip holds something.
    """
    changed = Simulation(_with(old.scene, moduli))
    if old.scene.dynamics:
        changed.restore(carry_motion(old.snapshot(), changed.snapshot()))
        return changed
    if holding := old.stepper.actuation.holding(old.state):
        text = f"grips hold something where it was taken, not at rest: {', '.join(holding)}"
        raise GdfeError(f"{text}; remedy: let go before moduli change, or `dynamics`")
    movable = [handle for handle in old.scene.handles if not (handle.fixed or handle.carrier)]
    handles = {handle.name: old.targets[handle.name] for handle in movable}
    actuators = {name: old.commands[name] for name in old.actuator_names}
    loads = {load.name: old.commands[load.name] for load in old.scene.loads}
    command = Command(handles=handles, actuators=actuators, loads=loads, joints=old.joint_goals)
    changed.step(command, dt=_LONG, interrupted=interrupted)
    changed.time = old.time
    return changed


def take_over(old: Simulation, new: Simulation) -> None:
    """Continue the motion of ``old`` in ``new``; their scenes differ only in rigid bodies and soft bodies.

    In the energy account, the energy of added or removed bodies counts as work.

    Raises:
        OverlapError: a new body is inside of an obstacle or of another body; ``new`` stays in its initial state.
    """
    fresh = new.snapshot()
    new.restore(with_bodies_of(old.snapshot(), fresh, _correspondence(old, new)))
    known = {handle.name for handle in old.scene.handles}
    added = [each.name for each in new.scene.rigid_bodies if each.name not in known]
    soft = parts_of(new.scene.mesh).keys() - parts_of(old.scene.mesh).keys()
    try:
        if added:
            new.state = put_rigid(new.stepper, new.state, dict.fromkeys(added, Pose()))
        require_soft_free(new.scene, new.state.poses, new.state.positions + new.origin, soft)
        for part in (new.scene.mesh.parts[name] for name in soft):
            vertices = part.first_vertex + np.arange(part.mesh.n_vertices)
            new.state = release(new.stepper, new.state, vertices)
    except OverlapError:
        new.restore(fresh)
        raise
    new.state = new.stepper.book_imbalance(new.state, old.stepper.find_imbalance(old.state))


def _correspondence(old: Simulation, new: Simulation) -> Correspondence:
    """Return the old index of each vertex, cell, material and freely moving handle part of a new simulation."""
    before, after = parts_of(old.scene.mesh), parts_of(new.scene.mesh)
    vertices = [_indices(before.get(name), part, "first_vertex", part.mesh.n_vertices) for name, part in after.items()]
    cells = [_indices(before.get(name), part, "first_cell", part.mesh.n_cells) for name, part in after.items()]
    names, handles = list(old.scene.materials), (old.scene.handles, new.scene.handles)
    return Correspondence(
        vertices=match_vertices(*handles, np.concatenate(vertices), len(new.state.positions)),
        cells=np.concatenate(cells),
        materials=np.array([names.index(name) if name in names else -1 for name in new.scene.materials]),
        loose=match_loose(*handles),
    )


def _indices(before: MeshPart | None, part: MeshPart, first: str, count: int) -> NDArray[np.intp]:
    """Return the old indices of the vertices or cells of a part; -1 for a part that is new."""
    return np.full(count, -1) if before is None else getattr(before, first) + np.arange(count)
