# SPDX-License-Identifier: Apache-2.0
"""Play the program of a scene over topics to a node in another process, which records the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import Header

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import NODE_NAME
from gdfe_ros.node.interface.topics import target_key
from gdfe_ros.node.messages import actuation, pose_stamped
from gdfe_ros.scene.scene import Scene
from gdfe_ros.testing.client import PATIENCE, NodeConnection
from gdfe_ros.testing.consumed import ACTUATION
from gdfe_ros.testing.process import NodeProcess


def play_program(
    scene: Scene,
    source: str,
    *,
    bag: Path,
    dt: float,
    steps: int | None = None,
    parameters: Mapping[str, Any] | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> float:
    """Start a node, command it step by step with a program, and stop it; return the duration of its start [s].

    The duration is the wall time until the node is ready for the first command.

    Args:
        scene: scene with a program.
        source: scene that the node loads: name, or path of its file.
        bag: directory of the recorded bag.
        dt: simulation time of a step [s].
        steps: number of steps of the program; None: the program's duration divided by dt.
        parameters: parameters of the node; they take precedence over the values for lockstep and recording.
        tell: function that is called after each step with the step's time in the program [s].

    Raises:
        GdfeError: the node ended, did not respond, ended with an error, or another node has its name; the message
            contains the node's log if it has one.
    """
    topics, duration = {key: type(each) for key, each in _messages(scene, 0.0).items()}, scene.program.duration
    settings = {
        "scene": source,
        "clock": "lockstep",
        "dt": dt,
        "record": True,
        "bag_path": str(bag),
        "command_set": list(topics),
        **(parameters or {}),
    }
    started = time.perf_counter()
    with NodeProcess(settings) as node, NodeConnection(node, f"/{NODE_NAME}", topics, patience=PATIENCE) as link:
        # Wait for step 0, the undeformed body: if it arrived later, it would be taken for that of the first command.
        link.wait_for_step(0)
        link.await_listeners()
        link.require_alone()
        first = time.perf_counter() - started
        tell(0.0)
        for moment in np.linspace(0.0, duration, (steps or round(duration / dt)) + 1)[1:]:
            last = link.step
            link.publish(_messages(scene, moment))
            link.wait_for_step(last + 1)
            tell(moment)
            link.look_for_doubles()
        if node.stop() != 0:
            raise GdfeError(f"the node ended with status {node.status}:\n{node.log}")
        return first


def _messages(scene: Scene, moment: float) -> dict[str, Any]:
    """Return a dict from command topic, relative to the node's name, to message, at the time ``moment`` [s]."""
    program, handles = scene.program, {handle.name: handle for handle in scene.handles}
    poses = program.handle_poses(moment).items()
    messages = {target_key(handles[name]): pose_stamped(Header(), pose) for name, pose in poses}
    values = program.actuator_values(moment) | program.load_factors(moment) | program.joint_positions(moment)
    if values:
        messages[ACTUATION] = actuation({actuator.name: actuator for actuator in scene.actuators}, values)
    return messages
