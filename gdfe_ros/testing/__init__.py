# SPDX-License-Identifier: Apache-2.0
"""Tools for tests of controllers: the node runs in a process of its own, in lockstep, with a controller in the loop.

Example: a test of a controller that moves the tip of a bar to a height:

    import numpy as np

    from gdfe_ros.constraints import Pose
    from gdfe_ros.simulation import Command
    from gdfe_ros.testing import Simulator, tracking_error

    def controller(state):
        height = state.positions[:, 2].max() - 0.025
        push = state.poses["tip"].translation[2] + 0.5 * (0.1 - height)
        return Command(handles={"tip": Pose((0.0, 0.0, push))})

    def test_the_controller_reaches_the_height():
        with Simulator("bend5") as simulator:
            states = simulator.run(controller, steps=30)
        heights = [[0.0, 0.0, state.poses["tip"].translation[2]] for state in states]
        assert tracking_error(heights[20:], np.array([0.0, 0.0, 0.1])).largest < 1e-3

Every run of such a test gives bitwise the same results.

`make_env` makes an environment of Gymnasium from a scene, in this process and without ROS. Public names are imported on
first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gdfe_ros.installation import remedy

if TYPE_CHECKING:
    from gdfe_ros.testing.environment import make_env, make_vector_env
    from gdfe_ros.testing.node_process import NodeProcess
    from gdfe_ros.testing.published_state import PublishedState, TrackingError, tracking_error
    from gdfe_ros.testing.simulator import Simulator

__all__ = [
    "NodeProcess",
    "PublishedState",
    "Simulator",
    "TrackingError",
    "make_env",
    "make_vector_env",
    "tracking_error",
]

_HOMES = {
    "NodeProcess": "node_process",
    "Simulator": "simulator",
    "PublishedState": "published_state",
    "TrackingError": "published_state",
    "make_env": "environment",
    "make_vector_env": "environment",
    "tracking_error": "published_state",
}


def __getattr__(name: str) -> Any:
    """Import a public name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it offers {__all__}")
    try:
        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    except ModuleNotFoundError as error:
        if (text := remedy(error)) is None:
            raise
        raise ModuleNotFoundError(f"{name} {text}", name=error.name) from error
    globals()[name] = value
    return value
