# SPDX-License-Identifier: Apache-2.0
"""Services of the node: its own, and those of ``simulation_interfaces``."""

from __future__ import annotations

import re

from gdfe_ros.node.interface import ServiceSpec


def _own(name: str, meaning: str, *, kind: str = "Trigger") -> ServiceSpec:
    return ServiceSpec(name=f"~/{name}", type=f"std_srvs/srv/{kind}", meaning=meaning)


def _standard(kind: str, meaning: str, *, form: str = "srv") -> ServiceSpec:
    """Return a standard service or action; its name is that of its type in lower case, with underscores."""
    name = re.sub("(?<=[a-z])(?=[A-Z])", "_", kind).lower()
    return ServiceSpec(name=f"~/{name}", type=f"simulation_interfaces/{form}/{kind}", meaning=meaning)


RESET = _own("reset", "go back to rest at time 0 and drop waiting commands")
RESET_COMMANDS = _own(
    "reset_commands",
    "drop waiting commands, velocities and trajectories; with the next step all targets, actuators and loads go "
    "back to their initial values, and the body follows",
)
RESET_BODIES = _own(
    "reset_bodies",
    "put every rigid body back to its rest pose, without velocity, with the next step; nothing else changes",
)
RESET_SHAPE = _own(
    "reset_shape",
    "put the elastic body back to its rest shape and all commands back to those of rest; time continues, and "
    "rigid bodies keep their places but lose their velocities. Not while a bag is written",
)
RESET_ARMS = _own(
    "reset_arms",
    "put all arms back to their initial joint positions at once; what an arm holds moves with it and keeps its "
    "shape. Time, loads, actuators and places of rigid bodies stay; velocities are the initial ones. Not while a "
    "bag is written",
)
PAUSE = _own("pause", "true: pause the stepping; false: continue", kind="SetBool")
STEP = _own(
    "step", "make `step_count` steps, and answer after they are published; only with clock `lockstep` or while paused"
)
RECORD = _own("record", "true: begin a bag at `bag_path`; false: finish it. Only while active", kind="SetBool")
SAVE_STATE = _own("save_state", "write the state to the file `state_path`")
LOAD_STATE = _own(
    "load_state",
    "go to the state in the file `state_path`, which must be of the same scene. Not while a bag is written",
)
COMPUTE_JACOBIAN = _own("compute_jacobian", "compute ~/jacobian at the present equilibrium and publish it")
GET_FEATURES = _standard("GetSimulatorFeatures", "list the features of the standard interfaces that the node supports")
GET_STATE = _standard(
    "GetSimulationState",
    "answer playing, paused, stopped (paused in the initial state, or not active), no world (unconfigured), or loading",
)
SET_STATE = _standard(
    "SetSimulationState", "play; pause; stop, which pauses and resets; or quit, which ends the process as SIGINT does"
)
RESET_SIMULATION = _standard(
    "ResetSimulation",
    "as ~/reset, and remove spawned bodies (scope 4, or all); time and state can only be reset together",
)
STEP_SIMULATION = _standard("StepSimulation", "as ~/step, with the number of steps in the request")
SIMULATE_STEPS = _standard(
    "SimulateSteps",
    "an action: as ~/step_simulation, with feedback after each step; it can be cancelled",
    form="action",
)
SPAWN_ENTITY = _standard(
    "SpawnEntity",
    "add a rigid body, from a URDF with one link (box, cylinder or sphere with a mass) or from YAML like an entry "
    "of `bodies`; or a soft body, from a mesh with its material. The scene needs `dynamics`. Not while a bag is "
    "written",
)
SPAWN_ENTITIES = _standard(
    "SpawnEntities", "as ~/spawn_entity for up to 100 bodies, one after another; each has a result of its own"
)
DELETE_ENTITY = _standard("DeleteEntity", "remove a spawned body. Not while a bag is written")
GET_ENTITIES = _standard(
    "GetEntities",
    "list the rigid bodies and the soft bodies beside the scene's body; filters: an expression for names, "
    "categories, tags (rigid, soft, spawned), a box or a sphere in the frame `frame_id`",
)
GET_ENTITY_STATE = _standard(
    "GetEntityState",
    "answer a body's pose and velocity after the last step, in the frame `frame_id`; those of a soft body are its "
    "mean ones",
)
GET_ENTITIES_STATES = _standard(
    "GetEntitiesStates", "answer names and states, all after the same step, with the filters of ~/get_entities"
)
SET_ENTITY_STATE = _standard(
    "SetEntityState",
    "teleport a body with the next step; it is then without velocity, and a soft one keeps its deformation. A "
    "velocity is refused",
)
GET_ENTITY_INFO = _standard("GetEntityInfo", "answer category, description and tags of a body")
GET_ENTITY_BOUNDS = _standard(
    "GetEntityBounds",
    "answer the box around a body as it is now, in the body's own frame: highest corner, lowest corner",
)
GET_SPAWNABLES = _standard(
    "GetSpawnables", "list the bodies of config/bodies, and the .yaml and .urdf files of the folders in `sources`"
)
GET_NAMED_POSES = _standard(
    "GetNamedPoses", "list the rest poses of handles, obstacles and probes, each with its kind as a tag"
)
LOAD_WORLD = _standard(
    "LoadWorld",
    "replace the scene by another one, from a file or a text; the present one steps on while the new one is "
    "prepared. The node is then active and paused at time 0",
)
UNLOAD_WORLD = _standard("UnloadWorld", "as the transitions deactivate and cleanup")
GET_CURRENT_WORLD = _standard("GetCurrentWorld", "answer name, file and description of the scene")
GET_AVAILABLE_WORLDS = _standard(
    "GetAvailableWorlds", "list the scenes of config/scenes, and the .yaml files of the folders in `additional_sources`"
)
FOLLOW_TRAJECTORY = ServiceSpec(
    name="~/follow_joint_trajectory",
    type="control_msgs/action/FollowJointTrajectory",
    meaning="an action: a trajectory as on ~/trajectory, with feedback after each step. `position` in its "
    "tolerances is the allowed distance between the trajectory and the commands in force, which rate limits may "
    "hold back. A later command of one of its actuators ends it. After a cancellation the commands keep their "
    "present values",
)
_ALL = [spec for spec in vars().values() if isinstance(spec, ServiceSpec)]
SERVICES = tuple(spec for spec in _ALL if spec.type.startswith("std_srvs/"))
STANDARD_SERVICES = tuple(spec for spec in _ALL if spec.type.startswith("simulation_interfaces/"))
"""Services offered if the package simulation_interfaces is installed, and its version has them."""
ACTIONS = tuple(spec for spec in _ALL if spec.type.startswith("control_msgs/"))
"""Actions offered if the package control_msgs is installed."""
