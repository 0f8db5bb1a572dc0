# SPDX-License-Identifier: Apache-2.0
"""Soft-robot simulation by geometry-driven finite elements, with ROS 2 topics in and out.

Example:
    >>> from gdfe_ros import Simulation, load_scene
    >>> simulation = Simulation(load_scene("bend5"))

Importing this package loads neither numpy nor numba nor ROS. The public names are imported on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gdfe_ros.constraints import Pose
    from gdfe_ros.scene.loader import load_scene
    from gdfe_ros.simulation import Command, Simulation

__version__ = "0.2.0"
__all__ = ["Command", "Pose", "Simulation", "__version__", "load_scene"]

_HOMES = {
    "Command": "gdfe_ros.simulation",
    "Pose": "gdfe_ros.constraints",
    "Simulation": "gdfe_ros.simulation",
    "load_scene": "gdfe_ros.scene.loader",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it offers {__all__}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
