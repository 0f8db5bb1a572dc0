# SPDX-License-Identifier: Apache-2.0
"""Names and descriptions of every parameter, topic and service of the node; topics are in ``topics.py``.

The node's declarations and the tables of its documentation page are both generated from this package.
"""

from __future__ import annotations

import re
from dataclasses import KW_ONLY, dataclass
from enum import Enum

NODE_NAME = "gdfe_sim"
FRAME = "base_link"
"""Frame of the rest shape, unless a parameter names another one (REP-105)."""
CELL_FIELDS = ("eps_eq", "J", "omega", "tangent", "energy_density")
"""Fields of the cells that can colour markers and pictures."""


class Changeable(Enum):
    """When a parameter may be changed."""

    START = "only at start"
    UNCONFIGURED = "while unconfigured"
    INACTIVE = "while not active"
    ALWAYS = "at any time"


class Delivery(Enum):
    """Quality of service of a topic: reliable, transient local, number of messages, published while not active, too."""

    STATE = True, True, 10, False  # subscribers that ask for it miss no step during discovery
    CLOUD = True, True, 1, False  # ten clouds of a large body are many bytes
    COMMAND = True, False, 1000, False
    LATCHED = True, True, 1, True
    EVENT = True, False, 100, True
    CLOCK = False, False, 1, False
    TRANSFORMS = True, False, 100, False  # as in tf2_ros
    FOLLOWED = False, False, 10, False  # the leader's publisher may be reliable or not

    def __init__(self, reliable: bool, local: bool, depth: int, always: bool) -> None:
        self.reliable, self.local, self.depth, self.always = reliable, local, depth, always


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter; its ROS descriptor and its row in the documentation are made from this description.

    Attributes:
        name: name of the parameter.
        default: default value; its type is the parameter's type.
        meaning: description in one sentence.
        unit: SI unit; empty for texts and switches.
        least: smallest allowed value; None: no bound.
        most: largest allowed value; None: no bound.
        choices: allowed texts; empty: any text.
        change: when the parameter may be changed.
    """

    name: str
    default: bool | int | float | str | list[str]
    meaning: str
    _: KW_ONLY
    unit: str = ""
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    change: Changeable = Changeable.ALWAYS

    @property
    def kind(self) -> str:
        """Name of the parameter's type, for users."""
        names = {bool: "bool", int: "integer", float: "double", str: "string", list: "list of strings"}
        return names[type(self.default)]

    @property
    def allowed(self) -> str:
        """Text with the allowed values, for users; empty if every value of the type is allowed."""
        return ", ".join(self.choices) or ("" if self.least is None else f"{self.least:g} to {self.most:g}")


@dataclass(frozen=True, kw_only=True)
class TopicSpec:
    """One topic. With ``{handle}`` in its name, it describes a topic for each handle; likewise for other items.

    Attributes:
        name: name as in rclpy: ``~/`` stands for the node's full name.
        type: ROS type, e.g. ``sensor_msgs/msg/PointCloud2``.
        meaning: contents of its messages, with units.
        delivery: quality of service.
        recorded: whether bags contain the topic.
    """

    name: str
    type: str
    meaning: str
    delivery: Delivery = Delivery.STATE
    recorded: bool = True

    def key(self, **names: str) -> str:
        """Return the name relative to the node's name, as in bags and ``command_set``; ``names`` fill the braces."""
        return self.name.removeprefix("~/").format(**names)


@dataclass(frozen=True, kw_only=True)
class ServiceSpec:
    """One service: name, ROS type, effect."""

    name: str
    type: str
    meaning: str

    @property
    def key(self) -> str:
        """Name relative to the node's name."""
        return self.name.removeprefix("~/")


_UP_TO_AN_HOUR = {"unit": "s", "least": 0.0, "most": 3600.0}

PARAMETERS = (
    ParameterSpec(
        "scene",
        "bend5",
        "name of a scene in config/scenes, or the path of a scene file",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        "scene_overrides",
        [""],
        "entries key=value that replace values of the scene, e.g. mesh.bar.cells=[25, 2, 2]; empty entries "
        "have no effect",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        "autostart",
        True,
        "configure and activate at start; if that fails, the node keeps running, unconfigured",
        change=Changeable.START,
    ),
    ParameterSpec(
        "required",
        False,
        "if `autostart` fails, end the process with status 1, e.g. for a script or a container",
        change=Changeable.START,
    ),
    ParameterSpec(
        "clock",
        "wall",
        "trigger of a step. wall: the wall clock, at `rate`; fast: the end of the step before; lockstep: a "
        "command set, or the service ~/step; external: each `dt` of another node's /clock (needs `use_sim_time`)",
        choices=("wall", "fast", "lockstep", "external"),
        change=Changeable.INACTIVE,
    ),
    ParameterSpec("rate", 100.0, "steps per second of wall time, with clock wall", unit="Hz", least=0.01, most=10e3),
    ParameterSpec("dt", 0.01, "simulation time of one step", unit="s", least=1e-6, most=1e3),
    ParameterSpec(
        "deadline",
        0.0,
        "wall time after which a step returns its best state; the next step continues from it; 0: no deadline",
        **_UP_TO_AN_HOUR,
    ),
    ParameterSpec(
        "cut_after",
        -1,
        "for replays: end each solve at the same point as the recorded one (`cut_after` of its step record), "
        "whatever the time; -1: never",
        least=-1,
        most=1_000_000_000,
    ),
    ParameterSpec(
        "heartbeat",
        1.0,
        "while nothing is commanded, interval of the steps that only publish; not with clock lockstep; 0: none",
        **_UP_TO_AN_HOUR,
    ),
    ParameterSpec(
        "publish_clock",
        False,
        "publish /clock, stamp with simulation time, and with clocks wall and fast keep stepping while nothing "
        "is commanded; only one node of a system may do this",
        change=Changeable.INACTIVE,
    ),
    ParameterSpec(
        "frame_id",
        FRAME,
        "frame of the rest shape (REP-105); every output has it in its header, except poses and wrenches of "
        "handles and obstacles",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        "publish_tf",
        True,
        "publish frames of handles, obstacles and probes on /tf and /tf_static, if tf2_msgs is installed",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        "follow",
        [""],
        "handles and obstacles that follow a topic or a frame: handle=topic:/arm/tool_pose (PoseStamped) or "
        "handle=frame:tool0 (TF, needs tf2_msgs); such a handle takes no other commands",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec("record", False, "write a bag while active", change=Changeable.INACTIVE),
    ParameterSpec(
        "bag_path", "", "directory of the next bag; it must not exist yet, or be empty. Empty text: runs/<scene>_<time>"
    ),
    ParameterSpec(
        "command_set",
        [""],
        "with clock lockstep, a step begins when each of these inputs has a command, e.g. handles/tip/target, "
        "commands; empty: when any input has one",
        change=Changeable.INACTIVE,
    ),
    ParameterSpec(
        "command_max_age",
        0.0,
        "largest age of a command; one with an older stamp is refused. The age is measured on the node's "
        "clock, which is simulation time if it publishes /clock; 0: no limit",
        **_UP_TO_AN_HOUR,
    ),
    ParameterSpec(
        "command_max_lead",
        0.5,
        "a command is refused if its stamp is ahead of the node's clock by more than this",
        **_UP_TO_AN_HOUR,
    ),
    ParameterSpec("velocity_timeout", 0.5, "simulation time for which a velocity command acts", **_UP_TO_AN_HOUR),
    ParameterSpec(
        "slew_time",
        0.5,
        "with clock wall or a deadline, shortest simulation time in which an actuator's command crosses its "
        "`range`; longer while steps do not converge in time; 0: a command acts at once. An actuator's `rate` in the "
        "scene limits it with every clock",
        **_UP_TO_AN_HOUR,
    ),
    ParameterSpec("step_count", 1, "number of steps that one call of ~/step makes", least=1, most=1_000_000),
    ParameterSpec("state_path", "", "path of the file for ~/save_state and ~/load_state"),
    ParameterSpec(
        "marker_rate", 5.0, "largest number of markers per second of wall time", unit="Hz", least=0.01, most=1000.0
    ),
    ParameterSpec(
        "marker_field",
        "eps_eq",
        "field that colours the markers, from its smallest value (violet) to its largest (yellow)",
        choices=CELL_FIELDS,
    ),
)

MODULUS = ParameterSpec(
    "materials.{material}.young",
    0.0,
    "Young's modulus of each linear and neo-Hookean material, while configured; initially the scene's value. "
    "After a change the body goes to its new equilibrium; with `dynamics` it continues to move from its present state. "
    "Not while a bag is written",
    unit="Pa",
    least=1.0,
    most=1e12,
)


def _own(name: str, meaning: str, *, kind: str = "Trigger") -> ServiceSpec:
    return ServiceSpec(name=f"~/{name}", type=f"std_srvs/srv/{kind}", meaning=meaning)


def _standard(kind: str, meaning: str, *, form: str = "srv") -> ServiceSpec:
    """Return a standard service or action; its name is ``kind`` in lower case with underscores."""
    name = re.sub("(?<=[a-z])(?=[A-Z])", "_", kind).lower()
    return ServiceSpec(name=f"~/{name}", type=f"simulation_interfaces/{form}/{kind}", meaning=meaning)


RESET = _own("reset", "go back to rest at time 0 and drop waiting commands")
RESET_COMMANDS = _own(
    "reset_commands",
    "drop waiting commands, velocities and trajectories; with the next step all targets, actuators and loads go back "
    "to their initial values, and the body follows",
)
RESET_BODIES = _own(
    "reset_bodies",
    "put every rigid body back to its rest pose, without velocity, with the next step; nothing else changes",
)
RESET_SHAPE = _own(
    "reset_shape",
    "put the elastic body back to its rest shape and all commands to their initial values; time continues, and rigid "
    "bodies keep their places but lose their velocities. Not while a bag is written",
)
RESET_ARMS = _own(
    "reset_arms",
    "put all arms back to their initial joint positions at once; what an arm holds moves with it and keeps its shape. "
    "Time, loads, actuators and places of rigid bodies stay; velocities return to their initial values. Not while a "
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
    "add a rigid body, from a URDF with one link (box, cylinder or sphere with a mass) or from YAML like an entry of "
    "`bodies`; or a soft body, from a mesh with its material. The scene needs `dynamics`. Not while a bag is written",
)
SPAWN_ENTITIES = _standard(
    "SpawnEntities", "as ~/spawn_entity for up to 100 bodies, one after another; each has a result of its own"
)
DELETE_ENTITY = _standard("DeleteEntity", "remove a spawned body. Not while a bag is written")
GET_ENTITIES = _standard(
    "GetEntities",
    "list the rigid bodies and the soft bodies beside the scene's body; filters: an expression for names, categories, "
    "tags (rigid, soft, spawned), a box or a sphere in the frame `frame_id`",
)
GET_ENTITY_STATE = _standard(
    "GetEntityState",
    "answer a body's pose and velocity after the last step, in the frame `frame_id`; for a soft body, its mean pose "
    "and velocity",
)
GET_ENTITIES_STATES = _standard(
    "GetEntitiesStates", "answer names and states of bodies, all after the same step; filters as for ~/get_entities"
)
SET_ENTITY_STATE = _standard(
    "SetEntityState",
    "teleport a body with the next step, to zero velocity; a soft body keeps its deformation. A request with a "
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
    "replace the scene by another one, from a file or a text; the present one steps on while the new one is prepared. "
    "The node is then active and paused at time 0",
)
UNLOAD_WORLD = _standard("UnloadWorld", "as the transitions deactivate and cleanup")
GET_CURRENT_WORLD = _standard("GetCurrentWorld", "answer name, file and description of the scene")
GET_AVAILABLE_WORLDS = _standard(
    "GetAvailableWorlds", "list the scenes of config/scenes, and the .yaml files of the folders in `additional_sources`"
)
FOLLOW_TRAJECTORY = ServiceSpec(
    name="~/follow_joint_trajectory",
    type="control_msgs/action/FollowJointTrajectory",
    meaning="an action: a trajectory as on ~/trajectory, with feedback after each step. In its tolerances, `position` "
    "is the allowed distance between the trajectory and the present commands, which rate limits may delay. A later "
    "command of one of its actuators ends it. After a cancellation the commands keep their present values",
)
_ALL = [spec for spec in vars().values() if isinstance(spec, ServiceSpec)]
SERVICES = tuple(spec for spec in _ALL if spec.type.startswith("std_srvs/"))
STANDARD_SERVICES = tuple(spec for spec in _ALL if spec.type.startswith("simulation_interfaces/"))
"""Services offered if the package simulation_interfaces is installed, and its version has them."""
ACTIONS = tuple(spec for spec in _ALL if spec.type.startswith("control_msgs/"))
"""Actions offered if the package control_msgs is installed."""
