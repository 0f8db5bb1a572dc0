# SPDX-License-Identifier: Apache-2.0
"""Energy of a body after an impact, for each time integration scheme: ``python -m benchmarks.blows``.

A cube of 0.1 m with 4^3 cells is thrown at a floor. The contact starts at several moments within a time step. Modulus
and time step are varied, so that the impact lasts from a hundred steps to a tenth of a step.
"""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.markdown import markdown_table
from gdfe_ros import Simulation
from gdfe_ros.scene.loader import scene_from_text

SPEED, PHASES, STEPS = 0.5, 6, 60
"""Speed of the cube [m/s], number of moments within a step at which the contact starts, and number of steps."""
CUBE = """
name: cube
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 1.0e6, poisson: 0.4, density: 1000}}
regions: [{material: soft}]
handles: {}
solver: {tolerance: 1.0e-5}
"""
CASES = ((1e4, 0.0005), (1e4, 0.005), (1e6, 0.0005), (1e6, 0.005), (1e7, 0.0002), (1e7, 0.002), (1e7, 0.01))
"""Young's modulus [Pa] and step [s]."""
SCHEMES = (
    ("newmark", {"scheme": "newmark"}),
    *((f"generalised_alpha, rho_inf {rho}", {"rho_inf": rho}) for rho in (0.9, 0.8, 0.5, 0.0)),
)


def thrown(
    text: str, scheme: Mapping[str, object], young: float, step: float, phase: float, *, lowest: float
) -> Simulation:
    """Return a simulation of a body that flies towards a floor and reaches it after 1 + ``phase`` steps.

    Args:
        text: YAML text of the scene.
        scheme: keys of the scene's dynamics that select the scheme.
        young: Young's modulus of the material ``soft`` [Pa].
        step: time step [s].
        phase: fraction of a step, 0 to 1.
        lowest: height of the body's lowest point [m].
    """
    floor = {"plane": [0, 0, 1], "at": [0, 0, lowest - (1.0 + phase) * SPEED * step], "fixed": True}
    keys = {
        "materials.soft.young": young,
        "dynamics": {**scheme, "step": step, "velocity": [0.0, 0.0, -SPEED]},
        "obstacles": {"floor": floor},
    }
    return Simulation(scene_from_text(text, overrides=keys))


def blow(scheme: Mapping[str, object], young: float, step: float, phase: float) -> tuple[float, float]:
    """Return the largest and the final energy of a cube, both divided by its energy after the first step.

    Raises:
        RuntimeError: a step has not converged.
    """
    simulation, held = thrown(CUBE, scheme, young, step, phase, lowest=-0.05), []
    for _ in range(STEPS):
        result = simulation.step()
        if not result.converged:
            raise RuntimeError(f"{scheme}, {young:g} Pa, {step:g} s: {result.message}")
        held.append(result.energies["kinetic"] + result.energies["elastic"])
    return max(held) / held[0], held[-1] / held[0]


def table() -> str:
    """Return the table of all schemes and cases."""
    rows = []
    for name, scheme in SCHEMES:
        cells = []
        for young, step in CASES:
            found = [blow(scheme, young, step, phase / PHASES) for phase in range(PHASES)]
            left = [end for _, end in found]
            cells.append(f"{max(most for most, _ in found) - 1.0:+.1e} ({min(left):.2f} to {max(left):.2f})")
        rows.append([name, *cells])
    return markdown_table(("scheme", *(f"{young:.0e} Pa, {1e3 * step:g} ms" for young, step in CASES)), rows)


if __name__ == "__main__":
    print(table())
