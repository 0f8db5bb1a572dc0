# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node: units, ranges, defaults, and when they may be changed."""

from __future__ import annotations

from gdfe_ros.node.specification import Change, ParameterSpec

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
        meaning="REP-105 frame of the rest shape, in the header of every output but poses and wrenches of handles and "
        "obstacles",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="publish_tf",
        default=True,
        meaning="publish frames of handles, obstacles and probes on /tf and /tf_static, where tf2_msgs is installed",
        change=Change.UNCONFIGURED,
    ),
    ParameterSpec(
        name="follow",
        default=[""],
        meaning="handles and obstacles that are held where something else is, as handle=topic:/arm/tool_pose "
        "(PoseStamped) or handle=frame:tool0 (TF, needs tf2_msgs); such a handle takes no other commands",
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
    ParameterSpec(
        name="slew_time",
        default=0.5,
        unit="s",
        least=0.0,
        most=3600.0,
        meaning="under the clock wall or with a deadline, simulation time in which an actuator crosses its `range` at "
        "most; slower while steps do not converge in time; 0: a command is in force at once. The scene's own `rate` of "
        "an actuator holds under every clock",
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
    "goes to its new equilibrium, or with `dynamics` moves on from where it is; not while a bag is written",
)
