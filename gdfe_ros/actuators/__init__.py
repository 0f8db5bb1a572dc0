# SPDX-License-Identifier: Apache-2.0
"""Actuators and loads of a body."""

from __future__ import annotations

from gdfe_ros.actuators.actuator import Actuator, ActuatorState, Cable, Chamber, Grip, Growth, Mode, Readings
from gdfe_ros.actuators.embedding import Embedding, embed
from gdfe_ros.actuators.load import AttachedMass, Gravity, Load, PointLoad, PressureLoad, SurfaceLoad, total_gravity

__all__ = [
    "Actuator",
    "ActuatorState",
    "AttachedMass",
    "Cable",
    "Chamber",
    "Embedding",
    "Gravity",
    "Grip",
    "Growth",
    "Load",
    "Mode",
    "PointLoad",
    "PressureLoad",
    "Readings",
    "SurfaceLoad",
    "embed",
    "total_gravity",
]
