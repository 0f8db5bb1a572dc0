# SPDX-License-Identifier: Apache-2.0
"""Every parameter, topic and service of the node: the one place where they are named and described.

The declarations of the node and the tables of README both come from here.
"""

from __future__ import annotations

from gdfe_ros.node.specification import Change, Delivery, ParameterSpec, ServiceSpec, TopicSpec

NODE_NAME = "gdfe_sim"


PARAMETERS = (
    ParameterSpec(
        name="scene",
        default="bend5",
        meaning="name of a scene in config/scenes, or the path of a scene file",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="scene_overrides",
        default=[""],
        meaning="entries key=value put over the scene, as mesh.bar.cells=[25, 2, 2]; empty ones do nothing",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="autostart",
        default=True,
        meaning="configure and activate at start; where that fails the node stays up, unconfigured",
        change=Change.START,
    ),
    ParameterSpec(
        name="clock",
        default="wall",
        choices=("wall", "fast", "lockstep", "external"),
        meaning="what makes a step begin: the wall clock at `rate`; nothing, the last one's end is enough; "
        "a command set or the service ~/step; another's /clock, one step each `dt` (needs `use_sim_time`)",
        change=Change.INACTIVE,
    ),
    ParameterSpec(name="rate", default=100.0, unit="Hz", least=0.01, most=10e3, meaning="steps a second, clock wall"),
    ParameterSpec(name="dt", default=0.01, unit="s", least=1e-6, most=1e3, meaning="simulation time of one step"),
    ParameterSpec(
        name="deadline",
        default=0.0,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="wall time after which a step returns its best state, and the next goes on from it; 0: none",
    ),
    ParameterSpec(
        name="cut_after",
        default=-1,
        least=-1,
        most=1_000_000_000,
        meaning="for replays: end each solve where a recorded one was ended (`cut_after` of its step record), "
        "whatever the time; -1: nowhere",
    ),
    ParameterSpec(
        name="heartbeat",
        default=1.0,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="interval of the steps that only publish, while nothing is commanded, but in lockstep; 0: none",
    ),
    ParameterSpec(
        name="publish_clock",
        default=False,
        meaning="publish /clock, stamp with simulation time, and keep stepping while nothing is commanded (clocks wall "
        "and fast); for one node of a system",
        change=Change.INACTIVE,
    ),
    ParameterSpec(
        name="frame_id",
        default="base_link",
        meaning="REP-105 frame of the rest shape, in the header of every output but poses and wrenches of handles",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="publish_tf",
        default=True,
        meaning="publish frames of handles and probes on /tf and /tf_static, where tf2_msgs is installed",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="follow",
        default=[""],
        meaning="handles that are held where something else is, as handle=topic:/arm/tool_pose (PoseStamped) or "
        "handle=frame:tool0 (TF, needs tf2_msgs); such a handle takes no other commands",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(name="record", default=False, meaning="write a bag while active", change=Change.INACTIVE),
    ParameterSpec(
        name="bag_path",
        default="",
        meaning="directory of the next bag, which must not exist or be empty; empty: runs/<scene>_<time>",
    ),
    ParameterSpec(
        name="command_set",
        default=[""],
        meaning="clock lockstep: a step begins when each of these inputs has a command, e.g. handles/tip/target, "
        "commands; empty: when any has",
        change=Change.INACTIVE,
    ),
    ParameterSpec(
        name="command_max_age",
        default=0.0,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="commands with an older stamp are refused, measured on the node's clock (the simulation's, "
        "where it publishes /clock); 0: no limit",
    ),
    ParameterSpec(
        name="command_max_lead",
        default=0.5,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="commands whose stamp lies farther ahead of the node's clock are refused",
    ),
    ParameterSpec(
        name="velocity_timeout",
        default=0.5,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="simulation time for which a velocity command stays in force",
    ),
    ParameterSpec(name="step_count", default=1, least=1, most=1_000_000, meaning="steps that one call of ~/step makes"),
    ParameterSpec(name="state_path", default="", meaning="file of ~/save_state and ~/load_state"),
    ParameterSpec(
        name="marker_rate",
        default=5.0,
        unit="Hz",
        least=0.01,
        most=1000.0,
        meaning="most markers a second of wall time",
    ),
    ParameterSpec(
        name="marker_field",
        default="eps_eq",
        choices=("eps_eq", "J", "omega", "tangent", "energy_density"),
        meaning="what the markers' colours show, from its least (violet) to its largest value (yellow)",
    ),
)

MODULUS = ParameterSpec(
    name="materials.{material}.young",
    default=0.0,
    unit="Pa",
    least=1.0,
    most=1e12,
    meaning="Young's modulus of each linear and neo-Hookean material while configured, at first the scene's; the body "
    "goes to its new equilibrium; not while a bag is written",
)

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
    "stamp 0 starts at once, another one on the node's clock, at most 60 s ahead",
    delivery=Delivery.COMMAND,
)
FOLLOWED = TopicSpec(
    name="",  # the parameter names it
    type="geometry_msgs/msg/PoseStamped",
    meaning="where a handle that follows a topic is held: pose of its frame in the header's; empty: the node's",
    delivery=Delivery.FOLLOWED,
)
COMMANDS = (TARGET, VELOCITY, ACTUATION, ACTUATOR_COMMANDS, TRAJECTORY)

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
PROBE = TopicSpec(
    name="~/probe/{probe}",
    type="geometry_msgs/msg/PoseStamped",
    meaning="where the material point is [m], and how the cell around it has turned",
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
TF = TopicSpec(
    name="/tf",
    type="tf2_msgs/msg/TFMessage",
    meaning="with `publish_tf`, in the node's frame: `<handle>`, which moves and turns with the handle, "
    "`<handle>_centre`, which keeps the axes, and `<probe>_probe`; not recorded",
    recorded=False,
    delivery=Delivery.TRANSFORMS,
)
TF_STATIC = TopicSpec(
    name="/tf_static",
    type="tf2_msgs/msg/TFMessage",
    meaning="with `publish_tf`: `<handle>_rest` in the node's frame; not recorded",
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
DIAGNOSTICS = TopicSpec(
    name="/diagnostics",
    type="diagnostic_msgs/msg/DiagnosticArray",
    meaning="once a second, as a whole and in parts, each with level and reason: solver and skipped work, commands "
    "taken and refused, bag, clock",
    recorded=False,
)
OUTPUTS = (
    MESH, STRAIN, HANDLE_POSE, HANDLE_WRENCH, HANDLE_SENSOR, PROBE, JOINT_STATES, JACOBIAN, STEP_RECORD, MARKERS, TF,
    TF_STATIC, TOPOLOGY, SCENE, DIAGNOSTICS, CLOCK,
)  # fmt: skip

RESET = ServiceSpec(
    name="~/reset", type="std_srvs/srv/Trigger", meaning="go back to rest at time 0; waiting commands are dropped"
)
PAUSE = ServiceSpec(name="~/pause", type="std_srvs/srv/SetBool", meaning="hold the stepping, or let it go on")
STEP = ServiceSpec(
    name="~/step",
    type="std_srvs/srv/Trigger",
    meaning="make `step_count` steps and answer when they are published; in lockstep, or while paused",
)
RECORD = ServiceSpec(
    name="~/record", type="std_srvs/srv/SetBool", meaning="begin a bag at `bag_path`, or finish it; while active"
)
SAVE_STATE = ServiceSpec(name="~/save_state", type="std_srvs/srv/Trigger", meaning="write the state to `state_path`")
LOAD_STATE = ServiceSpec(
    name="~/load_state",
    type="std_srvs/srv/Trigger",
    meaning="go to the state in `state_path`, of the same scene; not while a bag is written",
)
COMPUTE_JACOBIAN = ServiceSpec(
    name="~/compute_jacobian", type="std_srvs/srv/Trigger", meaning="publish ~/jacobian at the present equilibrium"
)
GET_FEATURES = ServiceSpec(
    name="~/get_simulator_features",
    type="simulation_interfaces/srv/GetSimulatorFeatures",
    meaning="what of the standard interfaces is supported",
)
GET_STATE = ServiceSpec(
    name="~/get_simulation_state",
    type="simulation_interfaces/srv/GetSimulationState",
    meaning="playing, paused, or stopped: paused at rest, or not active",
)
SET_STATE = ServiceSpec(
    name="~/set_simulation_state",
    type="simulation_interfaces/srv/SetSimulationState",
    meaning="play, pause, stop: pause and reset, or quit: end the process as SIGINT does",
)
RESET_SIMULATION = ServiceSpec(
    name="~/reset_simulation",
    type="simulation_interfaces/srv/ResetSimulation",
    meaning="as ~/reset; time and state together",
)
STEP_SIMULATION = ServiceSpec(
    name="~/step_simulation",
    type="simulation_interfaces/srv/StepSimulation",
    meaning="as ~/step, with the number of steps in the request",
)
SIMULATE_STEPS = ServiceSpec(
    name="~/simulate_steps",
    type="simulation_interfaces/action/SimulateSteps",
    meaning="an action: the same with feedback after each step; it can be cancelled",
)
STANDARD_SERVICES = (GET_FEATURES, GET_STATE, SET_STATE, RESET_SIMULATION, STEP_SIMULATION, SIMULATE_STEPS)
"""Where the package simulation_interfaces is installed."""

SERVICES = (RESET, PAUSE, STEP, RECORD, SAVE_STATE, LOAD_STATE, COMPUTE_JACOBIAN)
