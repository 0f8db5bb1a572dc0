# SPDX-License-Identifier: Apache-2.0
"""Topics of the node: `COMMANDS` are its inputs, `OUTPUTS` its publications."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.node.specification import Delivery, TopicSpec

TARGET = TopicSpec(
    name="~/handles/{handle}/target",
    type="geometry_msgs/msg/PoseStamped",
    meaning="target of the handle relative to its rest pose [m], rotation about its own centre by the nearest turn; "
    "`frame_id` empty, the node's or `<handle>_rest`; any other is looked up on TF, or refused by name",
    delivery=Delivery.COMMAND,
)
VELOCITY = TopicSpec(
    name="~/handles/{handle}/velocity",
    type="geometry_msgs/msg/TwistStamped",
    meaning="velocity of the handle's target [m/s], [rad/s], axes of the node's frame, in force for "
    "`velocity_timeout`; turns add up beyond 180 degrees; `frame_id` as for the target",
    delivery=Delivery.COMMAND,
)
OBSTACLE_TARGET = TopicSpec(
    name="~/obstacles/{obstacle}/target",
    type="geometry_msgs/msg/PoseStamped",
    meaning="target of the obstacle relative to its rest pose [m], rotation about its own origin by the nearest turn, "
    "axes of the node's frame, as in a program; `frame_id` empty, the node's or `<obstacle>_rest`; in any other, which "
    "is looked up on TF, it is where the frame `<obstacle>` is to be",
    delivery=Delivery.COMMAND,
)
OBSTACLE_VELOCITY = TopicSpec(
    name="~/obstacles/{obstacle}/velocity",
    type="geometry_msgs/msg/TwistStamped",
    meaning="velocity of the obstacle's target [m/s], [rad/s]; as of handles",
    delivery=Delivery.COMMAND,
)
BODY_SET = TopicSpec(
    name="~/bodies/{body}/set",
    type="geometry_msgs/msg/PoseStamped",
    meaning="puts the rigid body, before the next step, at a pose relative to its rest pose [m] and without velocity; "
    "from there it moves freely again; refused where something is; `frame_id` empty, the node's or `<body>_rest`; in "
    "any other, which is looked up on TF, it is where the frame `<body>` is to be",
    delivery=Delivery.COMMAND,
)
ACTUATION = TopicSpec(
    name="~/actuation",
    type="sensor_msgs/msg/JointState",
    meaning="commands of actuators by name: `effort` for tension [N] and pressure [Pa], `position` for length and "
    "shortening [m], volume [m^3], growth [1]; and of loads: `position` is the factor [1] on them",
    delivery=Delivery.COMMAND,
)
ACTUATOR_COMMANDS = TopicSpec(
    name="~/commands",
    type="std_msgs/msg/Float64MultiArray",
    meaning="one command for each actuator in the scene's order, unit of its mode (ros2_control's forward controllers)",
    delivery=Delivery.COMMAND,
)
TRAJECTORY = TopicSpec(
    name="~/trajectory",
    type="trajectory_msgs/msg/JointTrajectory",
    meaning="commands of actuators over simulation time: `positions` in the unit of each mode, linear in between; "
    "stamp 0 starts at once, another one on the node's clock, at most 60 s ahead; "
    "without points it ends those that run",
    delivery=Delivery.COMMAND,
)
FOLLOWED = TopicSpec(
    name="",  # named by the parameter
    type="geometry_msgs/msg/PoseStamped",
    meaning="where a handle or obstacle that follows a topic is held: its frame in the header's; empty: the node's",
    delivery=Delivery.FOLLOWED,
)
COMMANDS = (TARGET, VELOCITY, OBSTACLE_TARGET, OBSTACLE_VELOCITY, BODY_SET, ACTUATION, ACTUATOR_COMMANDS, TRAJECTORY)

CLOCK = TopicSpec(
    name="/clock",
    type="rosgraph_msgs/msg/Clock",
    meaning="simulation time, with `publish_clock`; a reset sets it back",
    delivery=Delivery.CLOCK,
)
MESH = TopicSpec(
    name="~/mesh",
    type="sensor_msgs/msg/PointCloud2",
    meaning="x, y, z, ux, uy, uz of each vertex [m], float32",
    delivery=Delivery.CLOUD,
)
STRAIN = TopicSpec(
    name="~/strain",
    type="sensor_msgs/msg/PointCloud2",
    meaning="x, y, z [m] of each cell's centroid, eps_eq, J, omega, tangent [Pa], energy_density [J/m^3], float32",
    delivery=Delivery.CLOUD,
)
VERTEX_VELOCITY = TopicSpec(
    name="~/velocity",
    type="sensor_msgs/msg/PointCloud2",
    meaning="x, y, z [m], vx, vy, vz [m/s] of each vertex, float32; only of scenes with `dynamics`",
    delivery=Delivery.CLOUD,
)
HANDLE_POSE = TopicSpec(
    name="~/handles/{handle}/pose",
    type="geometry_msgs/msg/PoseStamped",
    meaning="where the handle is, relative to its rest pose [m]: `frame_id` is `<handle>_rest`, the handle's centre at "
    "rest with the axes of the node's frame",
)
HANDLE_WRENCH = TopicSpec(
    name="~/handles/{handle}/wrench",
    type="geometry_msgs/msg/WrenchStamped",
    meaning="force [N] and moment [N m] that the handle exerts on the body, about the handle's present centre: "
    "`frame_id` is `<handle>_centre`, which moves with the handle and keeps the axes of the node's frame",
)
HANDLE_SENSOR = TopicSpec(
    name="~/handles/{handle}/force_torque",
    type="geometry_msgs/msg/WrenchStamped",
    meaning="what a force-torque sensor between the handle and what holds it reads: force [N] and moment [N m] which "
    "the body exerts on the handle, about its centre; `frame_id` is `<handle>`, which turns with it; not recorded",
    recorded=False,
)
OBSTACLE_POSE = TopicSpec(
    name="~/obstacles/{obstacle}/pose",
    type="geometry_msgs/msg/PoseStamped",
    meaning="where the obstacle is, relative to its rest pose [m]: `frame_id` is `<obstacle>_rest`, the origin of its "
    "shape at rest with the axes of the node's frame",
)
OBSTACLE_WRENCH = TopicSpec(
    name="~/obstacles/{obstacle}/wrench",
    type="geometry_msgs/msg/WrenchStamped",
    meaning="force [N] and moment [N m] that the obstacle exerts on the body, about the present origin of its shape: "
    "`frame_id` is `<obstacle>_centre`, which moves with it and keeps the axes of the node's frame",
)
BODY_POSE = TopicSpec(
    name="~/bodies/{body}/pose",
    type="geometry_msgs/msg/PoseStamped",
    meaning="where the rigid body is, relative to its rest pose [m]: `frame_id` is `<body>_rest`, its middle at rest "
    "with the axes of the node's frame",
)
BODY_WRENCH = TopicSpec(
    name="~/bodies/{body}/wrench",
    type="geometry_msgs/msg/WrenchStamped",
    meaning="force [N] and moment [N m] that the rigid body exerts on the elastic one, about its own present middle: "
    "`frame_id` is `<body>_centre`, which moves with it and keeps the axes of the node's frame",
)
CONTACTS = TopicSpec(
    name="~/contacts",
    type="sensor_msgs/msg/PointCloud2",
    meaning="each point that touches: x, y, z [m], normal nx, ny, nz out of what it touches, gap [m], force along the "
    "normal fx, fy, fz and by friction tx, ty, tz [N] on what touches, float32; slips (1, else 0), vertex (-1: corner "
    "of a rigid body), contact (place in `~/contact_names`), other (vertex that it touches, -1: none of the body), "
    "int32; only of scenes with `obstacles`, `bodies` or `self_contact`",
    delivery=Delivery.CLOUD,
)
CONTACT_NAMES = TopicSpec(
    name="~/contact_names",
    type="std_msgs/msg/String",
    meaning="JSON: the names that `contact` of `~/contacts` counts from 0: obstacles and bodies in the scene's order, "
    "which the elastic body touches, then `<body> on <obstacle>` and `<body> on <body>`, then `(self)`",
    delivery=Delivery.LATCHED,
)
SENSOR_WRENCH = TopicSpec(
    name="~/sensors/{sensor}/wrench",
    type="geometry_msgs/msg/WrenchStamped",
    meaning="force [N] and moment [N m] of all that touches the faces of a contact sensor on these, about the present "
    "mean of their vertices: `frame_id` is `<sensor>_sensor`, which moves with it, with the axes of the node's frame",
)
PROBE = TopicSpec(
    name="~/probe/{probe}",
    type="geometry_msgs/msg/PoseStamped",
    meaning="where the material point is [m], and how the cell around it has turned",
)
IMU = TopicSpec(
    name="~/probe/{probe}/imu",
    type="sensor_msgs/msg/Imu",
    meaning="what an inertial unit at the material point reads (REP-145): turn of the mean deformation of the cell "
    "around it; angular velocity [rad/s] and acceleration [m/s^2] in its own frame `<probe>_imu`, +9.81 upward at "
    "rest; covariances all 0: unknown; only of scenes with `dynamics`",
)
JOINT_STATES = TopicSpec(
    name="~/joint_states",
    type="sensor_msgs/msg/JointState",
    meaning="of each actuator: `position` length or shortening [m], volume [m^3] or growth [1], as it is commanded; "
    "`velocity` its rate; `effort` tension [N] or pressure [Pa]",
)
JACOBIAN = TopicSpec(
    name="~/jacobian",
    type="std_msgs/msg/Float64MultiArray",
    meaning="probes x 3 x actuators, d position / d command at the equilibrium, after ~/compute_jacobian; the layout's "
    "labels name probes and actuators",
)
STEP_RECORD = TopicSpec(
    name="~/step_record",
    type="std_msgs/msg/String",
    meaning="JSON: what the step consumed and how it went; all that a replay needs (gdfe_ros.recording.step_record)",
)
MARKERS = TopicSpec(
    name="~/markers",
    type="visualization_msgs/msg/Marker",
    meaning="the surface as triangles in the colours of `marker_field`, at most `marker_rate`; not recorded",
    recorded=False,
    delivery=Delivery.CLOUD,
)
CONTACT_MARKERS = TopicSpec(
    name="~/contact_markers",
    type="visualization_msgs/msg/MarkerArray",
    meaning="shapes of obstacles and rigid bodies, and forces as arrows from the points that touch, green where they "
    "stick and red where they slip, the largest so far 0.3 of the body's size long; at most `marker_rate`; not "
    "recorded; only of scenes with `obstacles`, `bodies` or `self_contact`",
    recorded=False,
    delivery=Delivery.CLOUD,
)
TF = TopicSpec(
    name="/tf",
    type="tf2_msgs/msg/TFMessage",
    meaning="with `publish_tf`, in the node's frame: `<handle>`, which moves and turns with the handle, "
    "`<handle>_centre`, which keeps the axes, the same of obstacles and rigid bodies, `<probe>_probe`, "
    "`<sensor>_sensor` and, of scenes with `dynamics`, "
    "`<probe>_imu`; not recorded",
    recorded=False,
    delivery=Delivery.TRANSFORMS,
)
TF_STATIC = TopicSpec(
    name="/tf_static",
    type="tf2_msgs/msg/TFMessage",
    meaning="with `publish_tf`: `<handle>_rest`, `<obstacle>_rest`, `<body>_rest` in the node's frame; not recorded",
    recorded=False,
    delivery=Delivery.LATCHED,
)
TOPOLOGY = TopicSpec(
    name="~/topology",
    type="std_msgs/msg/Int32MultiArray",
    meaning="m x 8 vertex numbers of the cells, VTK hexahedron order",
    delivery=Delivery.LATCHED,
)
SCENE = TopicSpec(
    name="~/scene",
    type="std_msgs/msg/String",
    meaning="the scene as YAML text that needs no other file",
    delivery=Delivery.LATCHED,
)
PROCESS = "process"
"""Key, on /diagnostics, of the number of the node's process, which tells nodes of one name apart."""
DIAGNOSTICS = TopicSpec(
    name="/diagnostics",
    type="diagnostic_msgs/msg/DiagnosticArray",
    meaning="once a second, as a whole and in parts, each with level and reason: solver and skipped work, commands "
    "taken and refused, bag, clock",
    recorded=False,
)
REFUSED = TopicSpec(
    name="~/refused",
    type="std_msgs/msg/String",
    meaning="JSON: `source` (a topic), `reason` (as counted on /diagnostics) and `message` of each command that is "
    "refused, at once",
    delivery=Delivery.EVENT,
    recorded=False,
)
OUTPUTS = (
    MESH, STRAIN, VERTEX_VELOCITY, HANDLE_POSE, HANDLE_WRENCH, HANDLE_SENSOR, OBSTACLE_POSE, OBSTACLE_WRENCH,
    BODY_POSE, BODY_WRENCH, CONTACTS, CONTACT_NAMES, SENSOR_WRENCH, PROBE, IMU, JOINT_STATES, JACOBIAN, STEP_RECORD,
    MARKERS, CONTACT_MARKERS, TF, TF_STATIC, TOPOLOGY, SCENE, DIAGNOSTICS, REFUSED,
    CLOCK,
)  # fmt: skip


@dataclass(frozen=True)
class Moved:
    """The topics of a handle, obstacle or rigid body; those with commands have ``target`` and ``velocity``.

    Freely moving bodies have ``put`` instead, which teleports them.
    """

    pose: TopicSpec
    wrench: TopicSpec
    target: TopicSpec | None = None
    velocity: TopicSpec | None = None
    put: TopicSpec | None = None

    @property
    def commands(self) -> tuple[TopicSpec, ...]:
        """Topics on which the node accepts commands."""
        return tuple(spec for spec in (self.target, self.velocity, self.put) if spec is not None)


MOVED = {
    "handles": Moved(HANDLE_POSE, HANDLE_WRENCH, TARGET, VELOCITY),
    "obstacles": Moved(OBSTACLE_POSE, OBSTACLE_WRENCH, OBSTACLE_TARGET, OBSTACLE_VELOCITY),
    "bodies": Moved(BODY_POSE, BODY_WRENCH, put=BODY_SET),
}
"""Topics by the section of the scene."""
