# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node: units, ranges, defaults, and when they may be changed."""

from __future__ import annotations

from gdfe_ros.node.interface import FRAME, Changeable, ParameterSpec

_UP_TO_AN_HOUR = {"unit": "s", "least": 0.0, "most": 3600.0}

PARAMETERS = (
    ParameterSpec(
        name="scene",
        default="bend5",
        meaning="name of a scene in config/scenes, or the path of a scene file",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        name="scene_overrides",
        default=[""],
        meaning="entries key=value that replace values of the scene, e.g. mesh.bar.cells=[25, 2, 2]; empty entries "
        "have no effect",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        name="autostart",
        default=True,
        meaning="configure and activate at start; if that fails, the node keeps running, unconfigured",
        change=Changeable.START,
    ),
    ParameterSpec(
        name="required",
        default=False,
        meaning="if `autostart` fails, end the process with status 1, e.g. for a script or a container",
        change=Changeable.START,
    ),
    ParameterSpec(
        name="clock",
        default="wall",
        choices=("wall", "fast", "lockstep", "external"),
        meaning="trigger of a step. wall: the wall clock, at `rate`; fast: the end of the step before; lockstep: a "
        "command set, or the service ~/step; external: each `dt` of another node's /clock (needs `use_sim_time`)",
        change=Changeable.INACTIVE,
    ),
    ParameterSpec(
        name="rate",
        default=100.0,
        unit="Hz",
        least=0.01,
        most=10e3,
        meaning="steps per second of wall time, with clock wall",
    ),
    ParameterSpec(name="dt", default=0.01, unit="s", least=1e-6, most=1e3, meaning="simulation time of one step"),
    ParameterSpec(
        name="deadline",
        default=0.0,
        **_UP_TO_AN_HOUR,
        meaning="wall time after which a step returns its best state; the next step continues from it; 0: no deadline",
    ),
    ParameterSpec(
        name="cut_after",
        default=-1,
        least=-1,
        most=1_000_000_000,
        meaning="for replays: end each solve at the same point as the recorded one (`cut_after` of its step "
        "record), whatever the time; -1: never",
    ),
    ParameterSpec(
        name="heartbeat",
        default=1.0,
        **_UP_TO_AN_HOUR,
        meaning="while nothing is commanded, interval of the steps that only publish; not with clock lockstep; 0: none",
    ),
    ParameterSpec(
        name="publish_clock",
        default=False,
        meaning="publish /clock, stamp with simulation time, and with clocks wall and fast keep stepping while "
        "nothing is commanded; only one node of a system may do this",
        change=Changeable.INACTIVE,
    ),
    ParameterSpec(
        name="frame_id",
        default=FRAME,
        meaning="frame of the rest shape (REP-105); the header of every output has it, except poses and wrenches of "
        "handles and obstacles",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        name="publish_tf",
        default=True,
        meaning="publish frames of handles, obstacles and probes on /tf and /tf_static, if tf2_msgs is installed",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(
        name="follow",
        default=[""],
        meaning="handles and obstacles that follow a topic or a frame: handle=topic:/arm/tool_pose (PoseStamped) or "
        "handle=frame:tool0 (TF, needs tf2_msgs); such a handle takes no other commands",
        change=Changeable.UNCONFIGURED,
    ),
    ParameterSpec(name="record", default=False, meaning="write a bag while active", change=Changeable.INACTIVE),
    ParameterSpec(
        name="bag_path",
        default="",
        meaning="directory of the next bag; it must not exist yet, or be empty. Empty text: runs/<scene>_<time>",
    ),
    ParameterSpec(
        name="command_set",
        default=[""],
        meaning="with clock lockstep, a step begins when each of these inputs has a command, e.g. handles/tip/target, "
        "commands; empty: when any input has one",
        change=Changeable.INACTIVE,
    ),
    ParameterSpec(
        name="command_max_age",
        default=0.0,
        **_UP_TO_AN_HOUR,
        meaning="largest age of a command; one with an older stamp is refused. The age is measured on the node's "
        "clock, which is simulation time if it publishes /clock; 0: no limit",
    ),
    ParameterSpec(
        name="command_max_lead",
        default=0.5,
        **_UP_TO_AN_HOUR,
        meaning="a command is refused if its stamp is ahead of the node's clock by more than this",
    ),
    ParameterSpec(
        name="velocity_timeout",
        default=0.5,
        **_UP_TO_AN_HOUR,
        meaning="simulation time for which a velocity command acts",
    ),
    ParameterSpec(
        name="slew_time",
        default=0.5,
        **_UP_TO_AN_HOUR,
        meaning="with clock wall or a deadline, shortest simulation time in which an actuator's command crosses its "
        "`range`; longer while steps do not converge in time; 0: a command acts at once. An actuator's `rate` in the "
        "scene limits it with every clock",
    ),
    ParameterSpec(
        name="step_count", default=1, least=1, most=1_000_000, meaning="number of steps that one call of ~/step makes"
    ),
    ParameterSpec(name="state_path", default="", meaning="path of the file for ~/save_state and ~/load_state"),
    ParameterSpec(
        name="marker_rate",
        default=5.0,
        unit="Hz",
        least=0.01,
        most=1000.0,
        meaning="largest number of markers per second of wall time",
    ),
    ParameterSpec(
        name="marker_field",
        default="eps_eq",
        choices=("eps_eq", "J", "omega", "tangent", "energy_density"),
        meaning="field that colours the markers, from its smallest value (violet) to its largest (yellow)",
    ),
)

MODULUS = ParameterSpec(
    name="materials.{material}.young",
    default=0.0,
    unit="Pa",
    least=1.0,
    most=1e12,
    meaning="Young's modulus of each linear and neo-Hookean material, while configured; initially the scene's value. "
    "After a change the body goes to its new equilibrium; with `dynamics` it continues to move from its present state. "
    "Not while a bag is written",
)
