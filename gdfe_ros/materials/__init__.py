# SPDX-License-Identifier: Apache-2.0
"""Stress-strain laws and a library of materials."""

from gdfe_ros.materials.curve_data import CurveData
from gdfe_ros.materials.invariant import ArrudaBoyce, Gent, Yeoh
from gdfe_ros.materials.material import (
    Curve,
    Law,
    Linear,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    StableNeoHookean,
    cell_densities,
    lacks_density,
)
from gdfe_ros.materials.presets import LIBRARY, PRESETS, preset

__all__ = [
    "LIBRARY",
    "PRESETS",
    "ArrudaBoyce",
    "Curve",
    "CurveData",
    "Gent",
    "Law",
    "Linear",
    "Material",
    "MooneyRivlin",
    "NeoHookean",
    "Ogden",
    "StableNeoHookean",
    "Yeoh",
    "cell_densities",
    "lacks_density",
    "preset",
]
