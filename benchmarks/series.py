# SPDX-License-Identifier: Apache-2.0
"""The tensile test of the paper's Sec. 5.3 as two springs in series: exact 1-D solution, and our two policies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from gdfe_ros.materials import Law, preset
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.settings import Policy, SolverSettings

ELONGATION = 1.0


@dataclass(frozen=True)
class Joint:
    """Position of the joint between the halves as a fraction of the deformed length, and mean strain of each half."""

    label: str
    position: float
    cheetah: float
    ninjaflex: float


PAPER: Sequence[Joint] = (
    Joint("experiment (paper)", 0.315, 0.268, 1.688),
    Joint("paper's method (paper)", 0.311, 0.239, 1.748),
    Joint("Abaqus, Ogden (paper)", 0.347, 0.388, 1.612),
)
"""Results in Table 2 of the paper."""


def exact_joint(law: Law) -> Joint:
    """Solve sigma_cheetah(e) = sigma_ninjaflex(2 - e) for two equal lengths that are together stretched by 100 %."""
    cheetah, ninjaflex = (preset(name, law=law, poisson=0.495) for name in ("cheetah", "ninjaflex"))

    def imbalance(strain: float) -> float:
        return float(cheetah.stress_at(np.array(strain)) - ninjaflex.stress_at(np.array(2.0 * ELONGATION - strain)))

    strain = brentq(imbalance, 1e-6, ELONGATION)
    return _joint(f"exact series solution, {law.name.lower()}", strain)


def simulated_joint(scene: str, policy: Policy) -> Joint:
    """Solve a tensile scene, and return the mean position of the joint's plane."""
    simulation = Simulation(load_scene(scene), settings=SolverSettings(policy=policy))
    result = list(simulation.play())[-1]
    rest = simulation.mesh.vertices[:, 0]
    half = 0.5 * rest.max()
    moved = float(result.positions[np.abs(rest - half) < 1e-9, 0].mean())
    return _joint(f"ours, {policy.value}, {scene}", moved / half - 1.0)


def _joint(label: str, strain: float) -> Joint:
    return Joint(label, (1.0 + strain) / (2.0 + 2.0 * ELONGATION), strain, 2.0 * ELONGATION - strain)
