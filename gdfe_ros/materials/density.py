# SPDX-License-Identifier: Apache-2.0
"""Densities of materials for gravity and dynamics."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials.material import Material


def lacks_density(materials: Mapping[str, Material], what: str) -> str:
    """Return a message that names the materials without a density; empty if every material has one.

    The message starts with ``what``, e.g. ``gravity needs``.
    """
    light = [key for key, material in materials.items() if material.density is None]
    return f"{what} a density: give `density` [kg/m^3] to {', '.join(light)}" if light else ""


def cell_densities(materials: Mapping[str, Material], cell_material: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the density (m,) [kg/m^3] of each cell; ``cell_material`` (m,) are the indices of the cells' materials."""
    return np.array([material.density for material in materials.values()])[cell_material]
