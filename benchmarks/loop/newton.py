# SPDX-License-Identifier: Apache-2.0
"""Distances to the equilibrium that owe nothing to a minimisation: one Newton step with the exact tangent.

This runs only with the package of `FROZEN`, whose internals do not change any more: its residual and its exact tangent,
with the response of pressures, hourglass scales and multipliers, judge positions that any commit has found. It holds as
long as the elements, laws and terms of that commit are those of today.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.loop.playing import list_commands, make_simulation

FROZEN = "b6cf3c23"
"""Commit whose residual and tangent judge."""


def measure_newton(task: Mapping[str, Any], path: str) -> dict[str, Any]:
    """Judge the positions in a file; return a dict from array to its distance and whether its tangent is definite.

    Args:
        task: request of a task.
        path: file of numpy with the arrays ``found N`` and ``truth N`` (n, 3) [m] after step N, and with the tensions
            [N] and pressures [Pa] of the actuators there.

    Returns:
        Dict from array to (length of the Newton step over the body's size, or None; definite or None). Empty if the
        scene has contacts, whose multipliers are not known.
    """
    simulation = make_simulation(task)
    if simulation.stepper.equilibrium.actuation.contacts:
        return {}
    level, found = _make_level(simulation), {}
    with np.load(path) as arrays:
        positions = {name: arrays[name] for name in arrays.files}
    for number, (command, _) in enumerate(list_commands(task, simulation)):
        simulation.targets = simulation._orders.targets(command, simulation.targets)
        simulation.commands = simulation._orders.values(command, simulation.commands)
        for name in (f"found {number}", f"truth {number}"):
            if name in positions:
                efforts = dict(zip(simulation.actuator_names, positions[f"efforts {name}"], strict=True))
                found[name] = _make_newton_step(simulation, level, positions[name], efforts)
    return found


def _make_level(simulation: Any) -> Any:
    """Return an evaluation of exact tangents."""
    # Modules of the frozen commit, in whose process this runs; they are not in this tree.
    TangentLevel = import_module("gdfe_ros.solver.tangent.level").TangentLevel
    curved = import_module("gdfe_ros.solver.sensitivity.curvature").curved
    WholeStiffness = import_module("gdfe_ros.solver.sensitivity.stiffness").WholeStiffness
    equilibrium = simulation.stepper.equilibrium
    body, own = equilibrium.body, curved(equilibrium.actuation.terms, equilibrium.body)
    return TangentLevel(body, equilibrium.matrix.assembled, own, elements=WholeStiffness(body, None))


def _make_newton_step(
    simulation: Any, level: Any, positions: np.ndarray, efforts: Mapping[str, float]
) -> tuple[float | None, bool | None]:
    """Return the length of the Newton step over the body's size, and whether the tangent is positive definite."""
    from gdfe_ros.errors import GdfeError
    from gdfe_ros.solver.sensitivity.linearised import Linearised

    equilibrium = simulation.stepper.equilibrium
    if not np.isfinite(positions).all():
        return None, None
    state = _make_state(simulation, positions - simulation.origin, efforts)
    try:
        linear = Linearised(equilibrium, level, state, state)
        turned = np.zeros(3 * equilibrium.body.unknowns.rigid_rows)
        change = linear.joint.updated(linear.x) - linear.multipliers
        step = linear.solve(linear.forces, change, turned).positions
    except GdfeError as error:
        return None, False if "no minimum" in str(error) else None
    return float(np.linalg.norm(step, axis=1).max()) / simulation.mesh.size, True


def _make_state(simulation: Any, positions: np.ndarray, efforts: Mapping[str, float]) -> Any:
    """Return the state at positions (n, 3) [m] with the present commands, and the pressures and scales of there.

    Args:
        simulation: the simulation, whose state stays.
        positions: positions relative to the origin.
        efforts: dict from actuator to its tension [N] or pressure [Pa].
    """
    from gdfe_ros.solver.elements.measures import update_hourglass_scales
    from gdfe_ros.solver.state import changed
    from gdfe_ros.solver.stepping.stepper import placed

    volume_pressures = import_module("gdfe_ros.solver.elements.fields").volume_pressures
    equilibrium, rest = simulation.stepper.equilibrium, simulation.stepper.at_rest()
    body, handles = equilibrium.body, equilibrium.handles
    operators = equilibrium.actuation.growths.at(simulation.commands, rest.operators)
    base = handles.base(simulation.targets, rest.poses, rest.base)
    given = {"poses": simulation.targets, "commands": simulation.commands, "base": base, "operators": operators}
    state = placed(body, handles, rest.with_(**given), positions, afresh=rest)
    scale, every = np.ones(len(body.material)), np.arange(len(body.material), dtype=np.int32)
    update_hourglass_scales(state.positions, every, operators.shape, body.material, body.table, scale)
    pressures = volume_pressures(body, state.positions, operators=operators)
    elements = changed(rest.elements, pressures=pressures, hourglass_scale=scale)
    held = {name: {"effort": np.full(2, efforts[name])} for name, saved in rest.terms.items() if "effort" in saved}
    return state.with_(elements=elements, terms={**rest.terms, **held}, summary=changed(state.summary, converged=True))
