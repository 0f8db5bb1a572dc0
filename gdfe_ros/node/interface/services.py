# SPDX-License-Identifier: Apache-2.0
"""Services of the node: its own, and those of ``simulation_interfaces``."""

from __future__ import annotations

from gdfe_ros.node.specification import ServiceSpec

RESET = ServiceSpec(
    name="~/reset", type="std_srvs/srv/Trigger", meaning="go back to rest at time 0; waiting commands are dropped"
)
RESET_COMMANDS = ServiceSpec(
    name="~/reset_commands",
    type="std_srvs/srv/Trigger",
    meaning="drop waiting commands, velocities and trajectories; with the next step all targets, actuators and loads "
    "go back to what they are at rest, the body follows",
)
RESET_BODIES = ServiceSpec(
    name="~/reset_bodies",
    type="std_srvs/srv/Trigger",
    meaning="put every rigid body back to its rest pose, without velocity, with the next step; all else goes on",
)
RESET_SHAPE = ServiceSpec(
    name="~/reset_shape",
    type="std_srvs/srv/Trigger",
    meaning="the elastic body goes back to its rest shape and all commands to those of rest; time goes on, rigid "
    "bodies stay where they are, without velocity; not while a bag is written",
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
FOLLOW_TRAJECTORY = ServiceSpec(
    name="~/follow_joint_trajectory",
    type="control_msgs/action/FollowJointTrajectory",
    meaning="an action: a trajectory as of ~/trajectory, with feedback after each step; `position` of its tolerances "
    "is how far the commands in force, which rate limits hold back, may be from it; a later command of one of its "
    "actuators ends it, a cancelled one leaves them where they are",
)
STANDARD_SERVICES = (GET_FEATURES, GET_STATE, SET_STATE, RESET_SIMULATION, STEP_SIMULATION, SIMULATE_STEPS)
"""Services offered if the package simulation_interfaces is installed."""
ACTIONS = (FOLLOW_TRAJECTORY,)
"""Actions offered if the package control_msgs is installed."""

SERVICES = (
    RESET,
    RESET_COMMANDS,
    RESET_BODIES,
    RESET_SHAPE,
    PAUSE,
    STEP,
    RECORD,
    SAVE_STATE,
    LOAD_STATE,
    COMPUTE_JACOBIAN,
)
