# SPDX-License-Identifier: Apache-2.0
"""Services of the node: its own, and those of ``simulation_interfaces``."""

from __future__ import annotations

from gdfe_ros.node.specification import ServiceSpec

RESET = ServiceSpec(
    name="~/reset", type="std_srvs/srv/Trigger", meaning="go back to rest at time 0 and drop waiting commands"
)
RESET_COMMANDS = ServiceSpec(
    name="~/reset_commands",
    type="std_srvs/srv/Trigger",
    meaning="drop waiting commands, velocities and trajectories; with the next step all targets, actuators and "
    "loads go back to their initial values, and the body follows",
)
RESET_BODIES = ServiceSpec(
    name="~/reset_bodies",
    type="std_srvs/srv/Trigger",
    meaning="put every rigid body back to its rest pose, without velocity, with the next step; nothing else changes",
)
RESET_SHAPE = ServiceSpec(
    name="~/reset_shape",
    type="std_srvs/srv/Trigger",
    meaning="put the elastic body back to its rest shape and all commands back to those of rest; time continues, and "
    "rigid bodies keep their places but lose their velocities. Not while a bag is written",
)
RESET_ARMS = ServiceSpec(
    name="~/reset_arms",
    type="std_srvs/srv/Trigger",
    meaning="put all arms back to their initial joint positions at once; what an arm holds moves with it and keeps its "
    "shape. Time, loads, actuators and places of rigid bodies stay; velocities are the initial ones. Not while a bag "
    "is written",
)
PAUSE = ServiceSpec(name="~/pause", type="std_srvs/srv/SetBool", meaning="true: pause the stepping; false: continue")
STEP = ServiceSpec(
    name="~/step",
    type="std_srvs/srv/Trigger",
    meaning="make `step_count` steps, and answer after they are published; only with clock `lockstep` or while paused",
)
RECORD = ServiceSpec(
    name="~/record",
    type="std_srvs/srv/SetBool",
    meaning="true: begin a bag at `bag_path`; false: finish it. Only while active",
)
SAVE_STATE = ServiceSpec(
    name="~/save_state", type="std_srvs/srv/Trigger", meaning="write the state to the file `state_path`"
)
LOAD_STATE = ServiceSpec(
    name="~/load_state",
    type="std_srvs/srv/Trigger",
    meaning="go to the state in the file `state_path`, which must be of the same scene. Not while a bag is written",
)
COMPUTE_JACOBIAN = ServiceSpec(
    name="~/compute_jacobian",
    type="std_srvs/srv/Trigger",
    meaning="compute ~/jacobian at the present equilibrium and publish it",
)
GET_FEATURES = ServiceSpec(
    name="~/get_simulator_features",
    type="simulation_interfaces/srv/GetSimulatorFeatures",
    meaning="list the features of the standard interfaces that the node supports",
)
GET_STATE = ServiceSpec(
    name="~/get_simulation_state",
    type="simulation_interfaces/srv/GetSimulationState",
    meaning="answer playing, paused, stopped (paused in the initial state, or not active), no world (unconfigured), or "
    "loading",
)
SET_STATE = ServiceSpec(
    name="~/set_simulation_state",
    type="simulation_interfaces/srv/SetSimulationState",
    meaning="play; pause; stop, which pauses and resets; or quit, which ends the process as SIGINT does",
)
RESET_SIMULATION = ServiceSpec(
    name="~/reset_simulation",
    type="simulation_interfaces/srv/ResetSimulation",
    meaning="as ~/reset, and remove spawned bodies (scope 4, or all); time and state can only be reset together",
)
STEP_SIMULATION = ServiceSpec(
    name="~/step_simulation",
    type="simulation_interfaces/srv/StepSimulation",
    meaning="as ~/step, with the number of steps in the request",
)
SIMULATE_STEPS = ServiceSpec(
    name="~/simulate_steps",
    type="simulation_interfaces/action/SimulateSteps",
    meaning="an action: as ~/step_simulation, with feedback after each step; it can be cancelled",
)
SPAWN_ENTITY = ServiceSpec(
    name="~/spawn_entity",
    type="simulation_interfaces/srv/SpawnEntity",
    meaning="add a rigid body, from a URDF with one link (box, cylinder or sphere with a mass) or from YAML like an "
    "entry of `bodies`; or a soft body, from a mesh with its material. The scene needs `dynamics`. Not while a bag is "
    "written",
)
SPAWN_ENTITIES = ServiceSpec(
    name="~/spawn_entities",
    type="simulation_interfaces/srv/SpawnEntities",
    meaning="as ~/spawn_entity for up to 100 bodies, one after another; each has a result of its own",
)
DELETE_ENTITY = ServiceSpec(
    name="~/delete_entity",
    type="simulation_interfaces/srv/DeleteEntity",
    meaning="remove a spawned body. Not while a bag is written",
)
GET_ENTITIES = ServiceSpec(
    name="~/get_entities",
    type="simulation_interfaces/srv/GetEntities",
    meaning="list the rigid bodies and the soft bodies beside the scene's body; filters: an expression for names, "
    "categories, tags (rigid, soft, spawned), a box or a sphere in the frame `frame_id`",
)
GET_ENTITIES_STATES = ServiceSpec(
    name="~/get_entities_states",
    type="simulation_interfaces/srv/GetEntitiesStates",
    meaning="answer names and states, all after the same step, with the filters of ~/get_entities",
)
GET_ENTITY_INFO = ServiceSpec(
    name="~/get_entity_info",
    type="simulation_interfaces/srv/GetEntityInfo",
    meaning="answer category, description and tags of a body",
)
GET_ENTITY_BOUNDS = ServiceSpec(
    name="~/get_entity_bounds",
    type="simulation_interfaces/srv/GetEntityBounds",
    meaning="answer the box around a body as it is now, in the body's own frame: highest corner, lowest corner",
)
GET_SPAWNABLES = ServiceSpec(
    name="~/get_spawnables",
    type="simulation_interfaces/srv/GetSpawnables",
    meaning="list the bodies of config/bodies, and the .yaml and .urdf files of the folders in `sources`",
)
GET_NAMED_POSES = ServiceSpec(
    name="~/get_named_poses",
    type="simulation_interfaces/srv/GetNamedPoses",
    meaning="list the rest poses of handles, obstacles and probes, each with its kind as a tag",
)
GET_ENTITY_STATE = ServiceSpec(
    name="~/get_entity_state",
    type="simulation_interfaces/srv/GetEntityState",
    meaning="answer a body's pose and velocity after the last step, in the frame `frame_id`; those of a soft body are "
    "its mean ones",
)
SET_ENTITY_STATE = ServiceSpec(
    name="~/set_entity_state",
    type="simulation_interfaces/srv/SetEntityState",
    meaning="teleport a body with the next step; it is then without velocity, and a soft one keeps its deformation. A "
    "velocity is refused",
)
LOAD_WORLD = ServiceSpec(
    name="~/load_world",
    type="simulation_interfaces/srv/LoadWorld",
    meaning="replace the scene by another one, from a file or a text; the present one steps on while the new one is "
    "prepared. The node is then active and paused at time 0",
)
UNLOAD_WORLD = ServiceSpec(
    name="~/unload_world",
    type="simulation_interfaces/srv/UnloadWorld",
    meaning="as the transitions deactivate and cleanup",
)
GET_CURRENT_WORLD = ServiceSpec(
    name="~/get_current_world",
    type="simulation_interfaces/srv/GetCurrentWorld",
    meaning="answer name, file and description of the scene",
)
GET_AVAILABLE_WORLDS = ServiceSpec(
    name="~/get_available_worlds",
    type="simulation_interfaces/srv/GetAvailableWorlds",
    meaning="list the scenes of config/scenes, and the .yaml files of the folders in `additional_sources`",
)
FOLLOW_TRAJECTORY = ServiceSpec(
    name="~/follow_joint_trajectory",
    type="control_msgs/action/FollowJointTrajectory",
    meaning="an action: a trajectory as on ~/trajectory, with feedback after each step. `position` in its "
    "tolerances is the allowed distance between the trajectory and the commands in force, which rate limits may "
    "hold back. A later command of one of its actuators ends it. After a cancellation the commands keep their "
    "present values",
)
STANDARD_SERVICES = (
    GET_FEATURES,
    GET_STATE,
    SET_STATE,
    RESET_SIMULATION,
    STEP_SIMULATION,
    SIMULATE_STEPS,
    SPAWN_ENTITY,
    SPAWN_ENTITIES,
    DELETE_ENTITY,
    GET_ENTITIES,
    GET_ENTITY_STATE,
    GET_ENTITIES_STATES,
    SET_ENTITY_STATE,
    GET_ENTITY_INFO,
    GET_ENTITY_BOUNDS,
    GET_SPAWNABLES,
    GET_NAMED_POSES,
    LOAD_WORLD,
    UNLOAD_WORLD,
    GET_CURRENT_WORLD,
    GET_AVAILABLE_WORLDS,
)
"""Services offered if the package simulation_interfaces is installed, and its version has them."""
ACTIONS = (FOLLOW_TRAJECTORY,)
"""Actions offered if the package control_msgs is installed."""

SERVICES = (
    RESET,
    RESET_COMMANDS,
    RESET_BODIES,
    RESET_SHAPE,
    RESET_ARMS,
    PAUSE,
    STEP,
    RECORD,
    SAVE_STATE,
    LOAD_STATE,
    COMPUTE_JACOBIAN,
)
