# SPDX-License-Identifier: Apache-2.0
"""Stress-strain laws and a library of materials."""

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.density import cell_densities, lacks_density
from gdfe_ros.materials.material import Curve, Law, Linear, Material, NeoHookean, Ogden
from gdfe_ros.materials.presets import LIBRARY, PRESETS, preset

__all__ = [
    "LIBRARY",
    "PRESETS",
    "Curve",
    "CurveData",
    "Law",
    "Linear",
    "Material",
    "NeoHookean",
    "Ogden",
    "cell_densities",
    "lacks_density",
    "preset",
]
