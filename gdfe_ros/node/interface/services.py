# SPDX-License-Identifier: Apache-2.0
"""Services of the node: its own, and those of ``simulation_interfaces``."""

from __future__ import annotations

from gdfe_ros.node.specification import ServiceSpec

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
