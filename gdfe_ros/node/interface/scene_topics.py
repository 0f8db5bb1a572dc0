# SPDX-License-Identifier: Apache-2.0
"""The topics of a scene: command topics of its handles and obstacles, and output topics of a step."""

from __future__ import annotations

from gdfe_ros.constraints import Handle
from gdfe_ros.contacts import contact_names
from gdfe_ros.node.interface import TopicSpec, topics
from gdfe_ros.scene.scene import Scene


def is_commanded(handle: Handle) -> bool:
    """Return whether a handle or obstacle accepts commands."""
    return not (handle.fixed or handle.carrier) and topics.MOVED[handle.section].target is not None


def target_key(handle: Handle) -> str:
    """Return the name of the target topic of a handle or obstacle, relative to the node's name."""
    return topics.MOVED[handle.section].target.key(**{handle.noun: handle.name})


def put_key(handle: Handle) -> str:
    """Return the name of the topic that teleports a rigid body, relative to the node's name."""
    return topics.MOVED[handle.section].put.key(**{handle.noun: handle.name})


def pose_and_wrench(handle: Handle) -> dict[str, TopicSpec]:
    """Return a dict from key to topic, first the pose, then the wrench, of a handle, obstacle or rigid body."""
    moved, brace = topics.MOVED[handle.section], {handle.noun: handle.name}
    return {spec.key(**brace): spec for spec in (moved.pose, moved.wrench)}


def state_topics(scene: Scene) -> dict[str, TopicSpec]:
    """Return a dict from key to topic of all topics with the state after a step, first the step record."""
    found = {spec.key(): spec for spec in (topics.STEP_RECORD, topics.MESH, topics.STRAIN)}
    for handle in scene.handles:
        found |= pose_and_wrench(handle)
    found |= {topics.PROBE.key(probe=name): topics.PROBE for name in scene.probes}
    if contact_names(scene.handles, scene.self_contact):
        found[topics.CONTACTS.key()] = topics.CONTACTS
    found |= {topics.SENSOR_WRENCH.key(sensor=name): topics.SENSOR_WRENCH for name in scene.sensors}
    if scene.dynamics is not None:
        found[topics.VERTEX_VELOCITY.key()] = topics.VERTEX_VELOCITY
        found |= {topics.IMU.key(probe=name): topics.IMU for name in scene.probes}
    if scene.actuators or scene.arms:
        found[topics.JOINT_STATES.key()] = topics.JOINT_STATES
    return found
