# SPDX-License-Identifier: Apache-2.0
"""What energy a body has after a blow: ``python -m benchmarks.blows``.

A cube of 0.1 m, 4^3 cells, is thrown at a floor, which it reaches at several moments of a step. Soft and long steps,
stiff and short ones: from blows of a hundred steps to such as are over in a tenth of one.
"""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.markdown import markdown_table
from gdfe_ros import Simulation
from gdfe_ros.scene.loader import scene_from_text

SPEED, PHASES, STEPS = 0.5, 6, 60
"""In which it flies [m/s]; moments of a step; and steps that are made."""
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
    """Return a body that flies at a floor, which it reaches ``phase`` of a step after the first one.

    Args:
        text: its scene.
        scheme: of the dynamics.
        young: modulus of its material ``soft`` [Pa].
        step: [s].
        phase: 0 to 1.
        lowest: where it ends below [m].
    """
    floor = {"plane": [0, 0, 1], "at": [0, 0, lowest - (1.0 + phase) * SPEED * step], "fixed": True}
    keys = {
        "materials.soft.young": young,
        "dynamics": {**scheme, "step": step, "velocity": [0.0, 0.0, -SPEED]},
        "obstacles": {"floor": floor},
    }
    return Simulation(scene_from_text(text, overrides=keys))


def blow(scheme: Mapping[str, object], young: float, step: float, phase: float) -> tuple[float, float]:
    """Return the most energy that a cube has and what it has in the end, over what it was thrown with.

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
