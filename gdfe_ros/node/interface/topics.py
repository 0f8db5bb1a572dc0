# SPDX-License-Identifier: Apache-2.0
"""Topics of the node: `COMMANDS` are its inputs, `OUTPUTS` its publications."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gdfe_ros.node.interface import Delivery, TopicSpec

if TYPE_CHECKING:
    from gdfe_ros.constraints import Handle
    from gdfe_ros.scene.scene import Scene


def _command(name: str, kind: str, meaning: str) -> TopicSpec:
    return TopicSpec(name=name, type=kind, meaning=meaning, delivery=Delivery.COMMAND)


def _cloud(name: str, meaning: str) -> TopicSpec:
    return TopicSpec(name=name, type="sensor_msgs/msg/PointCloud2", meaning=meaning, delivery=Delivery.CLOUD)


def _pose(name: str, meaning: str) -> TopicSpec:
    return TopicSpec(name=name, type="geometry_msgs/msg/PoseStamped", meaning=meaning)


def _wrench(name: str, meaning: str, **options: bool) -> TopicSpec:
    return TopicSpec(name=name, type="geometry_msgs/msg/WrenchStamped", meaning=meaning, **options)


def _text(name: str, meaning: str, **options: Delivery | bool) -> TopicSpec:
    return TopicSpec(name=name, type="std_msgs/msg/String", meaning=meaning, **options)


TARGET = _command(
    "~/handles/{handle}/target",
    "geometry_msgs/msg/PoseStamped",
    "target pose of the handle relative to its rest pose [m]; the rotation is about the handle's centre; of equivalent "
    "rotation vectors, the node uses the nearest to the present target. `frame_id` is empty, the node's, or "
    "`<handle>_rest`; a target in any other frame is transformed by TF, and refused if TF does not know the frame",
)
VELOCITY = _command(
    "~/handles/{handle}/velocity",
    "geometry_msgs/msg/TwistStamped",
    "velocity of the handle's target [m/s], [rad/s], in the axes of the node's frame; it acts for `velocity_timeout`. "
    "Rotations add up beyond 180 degrees. `frame_id` as for the target",
)
OBSTACLE_TARGET = _command(
    "~/obstacles/{obstacle}/target",
    "geometry_msgs/msg/PoseStamped",
    "target pose of the obstacle relative to its rest pose [m], in the axes of the node's frame, as in a program; the "
    "rotation is about the obstacle's origin; of equivalent rotation vectors, the node uses the nearest to the present "
    "target. `frame_id` is empty, the node's, or `<obstacle>_rest`; in any other frame, which TF must know, the target "
    "is the pose of the frame `<obstacle>`",
)
OBSTACLE_VELOCITY = _command(
    "~/obstacles/{obstacle}/velocity",
    "geometry_msgs/msg/TwistStamped",
    "velocity of the obstacle's target [m/s], [rad/s]; as for handles",
)
BODY_SET = _command(
    "~/bodies/{body}/set",
    "geometry_msgs/msg/PoseStamped",
    "puts the rigid body, before the next step, at a pose relative to its rest pose [m], without velocity; from there "
    "it moves freely again. Refused if the place is occupied. `frame_id` is empty, the node's, or `<body>_rest`; in "
    "any other frame, which TF must know, the pose is that of the frame `<body>`",
)
ACTUATION = _command(
    "~/actuation",
    "sensor_msgs/msg/JointState",
    "commands of actuators and loads by name. Actuators: `effort` if the actuator's mode commands its effort, such as "
    "a tension, else `position`, in the unit of the mode. Loads: `position` is the factor [1] on the load. Joints of "
    "arms: `position` [rad], [m]",
)
ACTUATOR_COMMANDS = _command(
    "~/commands",
    "std_msgs/msg/Float64MultiArray",
    "one command for each actuator, in the order of the scene and the unit of its mode (for the forward controllers of "
    "ros2_control)",
)
TRAJECTORY = _command(
    "~/trajectory",
    "trajectory_msgs/msg/JointTrajectory",
    "commands of actuators and of joints of arms over simulation time: `positions` in the unit of each actuator's "
    "mode, or in rad or m. They are interpolated as by joint_trajectory_controller: linear; cubic with `velocities` at "
    "all points; quintic with `accelerations`, too. A stamp of 0 starts the trajectory at once; any other stamp is a "
    "time on the node's clock, at most 60 s ahead. A trajectory without points ends the running ones",
)
JOINT_COMMAND = _command(
    "~/joint_command",
    "sensor_msgs/msg/JointState",
    "commanded `position` of joints of arms by name [rad], [m]; joints that are not named stay at their commands. The "
    "joints approach their commands within the limits of velocity and acceleration; a position beyond a joint's limits "
    "is refused. Actuators and loads can be commanded as on ~/actuation. Only in scenes with `arm` or `arms`",
)
ATTACH = _command(
    "~/attach",
    "std_msgs/msg/String",
    "name of a grip, which takes hold with the next step; refused if it holds already. If nothing is within its "
    "`reach`, the step refuses it. The same as command 1 on ~/actuation. Only in scenes with grips",
)
RELEASE = _command(
    "~/release",
    "std_msgs/msg/String",
    "name of a grip, which lets go with the next step; refused if it holds nothing. The same as command 0 on "
    "~/actuation. Only in scenes with grips",
)
FOLLOWED = TopicSpec(
    name="",  # named by the parameter
    type="geometry_msgs/msg/PoseStamped",
    meaning="pose at which a handle or obstacle with `follow` is held: the place of its frame in the header's frame; "
    "an empty `frame_id` is the node's frame",
    delivery=Delivery.FOLLOWED,
)
MESH = _cloud("~/mesh", "position x, y, z and displacement ux, uy, uz of each vertex [m], float32")
STRAIN = _cloud(
    "~/strain",
    "of each cell: centroid x, y, z [m], equivalent strain eps_eq, elastic volume ratio J (without growth), shape "
    "factor omega, tangent modulus tangent [Pa], energy_density per undeformed volume [J/m^3], float32",
)
VERTEX_VELOCITY = _cloud(
    "~/velocity",
    "position x, y, z [m] and velocity vx, vy, vz [m/s] of each vertex, float32; only in scenes with `dynamics`",
)
HANDLE_POSE = _pose(
    "~/handles/{handle}/pose",
    "present pose of the handle relative to its rest pose [m]; `frame_id` is `<handle>_rest`: the handle's undeformed "
    "centre, with the axes of the node's frame",
)
HANDLE_WRENCH = _wrench(
    "~/handles/{handle}/wrench",
    "force [N] and moment [N m] that the handle exerts on the body, about the handle's present centre; `frame_id` is "
    "`<handle>_centre`, which moves with the handle and keeps the axes of the node's frame",
)
HANDLE_SENSOR = _wrench(
    "~/handles/{handle}/force_torque",
    "reading of a force-torque sensor between the handle and its holder: force [N] and moment [N m] that the body "
    "exerts on the handle, about its centre; `frame_id` is `<handle>`, which turns with it. Not recorded",
    recorded=False,
)
OBSTACLE_POSE = _pose(
    "~/obstacles/{obstacle}/pose",
    "present pose of the obstacle relative to its rest pose [m]; `frame_id` is `<obstacle>_rest`: the initial origin "
    "of its shape, with the axes of the node's frame",
)
OBSTACLE_WRENCH = _wrench(
    "~/obstacles/{obstacle}/wrench",
    "force [N] and moment [N m] that the obstacle exerts on the body, about the present origin of its shape; "
    "`frame_id` is `<obstacle>_centre`, which moves with it and keeps the axes of the node's frame",
)
BODY_POSE = _pose(
    "~/bodies/{body}/pose",
    "present pose of the rigid body relative to its rest pose [m]; `frame_id` is `<body>_rest`: its centre at rest, "
    "with the axes of the node's frame",
)
BODY_WRENCH = _wrench(
    "~/bodies/{body}/wrench",
    "force [N] and moment [N m] that the rigid body exerts on the elastic one, about the rigid body's present centre; "
    "`frame_id` is `<body>_centre`, which moves with it and keeps the axes of the node's frame",
)
LINK_POSE = _pose(
    "~/links/{link}/pose",
    "present pose of a piece of an arm's link relative to its rest pose [m], as for obstacles; pieces are "
    "`<link>_piece`, `<link>_piece_2`",
)
LINK_WRENCH = _wrench(
    "~/links/{link}/wrench",
    "force [N] and moment [N m] that a piece of an arm's link exerts on the body, about the present origin of its "
    "shape, in the axes of the node's frame",
)
CONTACTS = _cloud(
    "~/contacts",
    "each point in contact. float32: position x, y, z [m]; normal nx, ny, nz out of the touched surface; gap [m]; "
    "normal force fx, fy, fz and friction force tx, ty, tz [N] on the point. int32: slips (1: slips, 0: sticks), "
    "vertex (id of the point; -1: corner of a rigid body), contact (index in `~/contact_names`), other (id of the "
    "touched vertex; -1: the touched surface is not the elastic body's). Only in scenes with `obstacles`, `bodies` or "
    "`self_contact`",
)
CONTACT_NAMES = _text(
    "~/contact_names",
    "JSON: list of the names to which `contact` in `~/contacts` is an index from 0: first obstacles and rigid bodies "
    "that the elastic body can touch, in the order of the scene; then `<body> on <obstacle>` and `<body> on <body>`; "
    "then `(self)`",
    delivery=Delivery.LATCHED,
)
SENSOR_WRENCH = _wrench(
    "~/sensors/{sensor}/wrench",
    "force [N] and moment [N m] of all contacts on the sensor's faces, about the present mean of their vertices; "
    "`frame_id` is `<sensor>_sensor`, which moves with this point and keeps the axes of the node's frame",
)
PROBE = _pose(
    "~/probe/{probe}", "present position of the material point [m], and rotation of the cell around it since rest"
)
IMU = TopicSpec(
    name="~/probe/{probe}/imu",
    type="sensor_msgs/msg/Imu",
    meaning="reading of an inertial measurement unit at the material point (REP-145): `orientation` is the rotation of "
    "the mean deformation of the cell around it; angular velocity [rad/s] and acceleration [m/s^2] are in its own "
    "frame `<probe>_imu`; at rest the acceleration is +9.81 upward. All covariances are 0, which means unknown. Only "
    "in scenes with `dynamics`",
)
JOINT_STATES = TopicSpec(
    name="~/joint_states",
    type="sensor_msgs/msg/JointState",
    meaning="for each actuator, `position` is its extent, e.g. a length, or its command if this is neither extent nor "
    "effort; `velocity` is the rate of `position`; `effort` is its effort, e.g. a tension. The mode of the actuator "
    "gives names and units. Then for each joint of the arms: position [rad], [m], velocity, and the effort of its "
    "motor [N m], [N], which holds and moves the links and the soft body",
)
JACOBIAN = TopicSpec(
    name="~/jacobian",
    type="std_msgs/msg/Float64MultiArray",
    meaning="derivatives of the probes' positions with respect to the actuators' commands at the equilibrium, an array "
    "probes x 3 x actuators; published after ~/compute_jacobian. The labels of its layout name probes and actuators",
)
STEP_RECORD = _text(
    "~/step_record",
    "JSON: the commands that the step used and its outcome; everything that a replay needs (gdfe_ros.recording.step)",
)
MARKERS = TopicSpec(
    name="~/markers",
    type="visualization_msgs/msg/Marker",
    meaning="the surface as triangles, coloured by `marker_field`; published at `marker_rate` at most. Not recorded",
    recorded=False,
    delivery=Delivery.CLOUD,
)
CONTACT_MARKERS = TopicSpec(
    name="~/contact_markers",
    type="visualization_msgs/msg/MarkerArray",
    meaning="shapes of obstacles and rigid bodies, and contact forces as arrows from the points in contact: green if "
    "the point sticks, red if it slips. The largest force so far has an arrow of 0.3 of the body's size. Published at "
    "`marker_rate` at most. Not recorded. Only in scenes with `obstacles`, `bodies` or `self_contact`",
    recorded=False,
    delivery=Delivery.CLOUD,
)
TF = TopicSpec(
    name="/tf",
    type="tf2_msgs/msg/TFMessage",
    meaning="if `publish_tf` is true, these frames, whose parent is the node's frame: `<handle>`, which moves and "
    "turns with the handle; `<handle>_centre`, which moves with it and keeps the axes of the node's frame; the same "
    "two for obstacles and rigid bodies; `<probe>_probe`; `<sensor>_sensor`; in scenes with `dynamics` also "
    "`<probe>_imu`; `<mesh>_mesh` for each of several meshes, as best fits its vertices. Every link of an arm has a "
    "frame of its own name, whose parent is the frame of the parent link, as with robot_state_publisher. Not recorded",
    recorded=False,
    delivery=Delivery.TRANSFORMS,
)
TF_STATIC = TopicSpec(
    name="/tf_static",
    type="tf2_msgs/msg/TFMessage",
    meaning="if `publish_tf` is true: `<handle>_rest`, `<obstacle>_rest` and `<body>_rest` in the node's frame. Not "
    "recorded",
    recorded=False,
    delivery=Delivery.LATCHED,
)
TOPOLOGY = TopicSpec(
    name="~/topology",
    type="std_msgs/msg/Int32MultiArray",
    meaning="vertex ids of the cells, an array m x 8 in VTK's order for hexahedra",
    delivery=Delivery.LATCHED,
)
SCENE = _text(
    "~/scene", "the scene as YAML text; meshes are embedded, so that it needs no other file", delivery=Delivery.LATCHED
)
ROBOT_DESCRIPTION = _text(
    "~/arms/{arm}/robot_description",
    "URDF of the arm, with its prefix, as robot_state_publisher publishes it",
    delivery=Delivery.LATCHED,
    recorded=False,
)
PROCESS = "process"
"""Key of the node's process id on /diagnostics; the id distinguishes nodes of the same name."""
DIAGNOSTICS = TopicSpec(
    name="/diagnostics",
    type="diagnostic_msgs/msg/DiagnosticArray",
    meaning="once a second: a summary, and one entry each for the solver with the skipped work, the accepted and "
    "refused commands, the bag, and the clock; each entry has a level and the reason for it",
    recorded=False,
)
REFUSED = _text(
    "~/refused",
    "JSON for each refused command, at once: `source` (the full name of its topic, service or action), `reason` (as "
    "counted on /diagnostics), `message`, and `late` (true: the step that consumed the command refused it)",
    delivery=Delivery.EVENT,
    recorded=False,
)
CLOCK = TopicSpec(
    name="/clock",
    type="rosgraph_msgs/msg/Clock",
    meaning="simulation time, if `publish_clock` is true; a reset sets it back to 0",
    delivery=Delivery.CLOCK,
)
_ALL = [spec for spec in vars().values() if isinstance(spec, TopicSpec) and spec.name]
COMMANDS = tuple(spec for spec in _ALL if spec.delivery is Delivery.COMMAND)
OUTPUTS = tuple(spec for spec in _ALL if spec.delivery is not Delivery.COMMAND)


POSE_COMMANDS = {"handles": TARGET, "obstacles": OBSTACLE_TARGET, "bodies": BODY_SET}
"""Dict from a section of the scene to the topic that commands the pose of each of its items; bodies are teleported."""
VELOCITY_COMMANDS = {"handles": VELOCITY, "obstacles": OBSTACLE_VELOCITY}
"""Dict from a section of the scene to the topic that commands the velocity of each of its items."""


def is_commanded(handle: Handle) -> bool:
    """Return whether a handle or obstacle accepts targets and velocities."""
    return not (handle.fixed or handle.carrier) and handle.section in VELOCITY_COMMANDS


def pose_key(handle: Handle) -> str:
    """Return the topic, relative to the node's name, of a handle's or obstacle's target, or of a body's teleports."""
    return POSE_COMMANDS[handle.section].key(**{handle.noun: handle.name})


def step_topic(key: str) -> TopicSpec:
    """Return the output topic for a name relative to the node's name, e.g. `HANDLE_POSE` for ``handles/tip/pose``."""
    return next(spec for spec in OUTPUTS if re.fullmatch(re.sub("{.*}", "[^/]+", spec.name), f"~/{key}"))


def state_topics(scene: Scene) -> dict[str, TopicSpec]:
    """Return a dict from key to topic for the recorded topics with a message for each step; the step record first."""
    from gdfe_ros.recording.message_tables import tables_of  # the terminal's commands for other nodes need no scene

    specs = {key: step_topic(key) for key in (STEP_RECORD.key(), *tables_of(scene))}
    return {key: spec for key, spec in specs.items() if spec.recorded}
