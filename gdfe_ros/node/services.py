# SPDX-License-Identifier: Apache-2.0
"""The node that has a session, and its services: each is executed between two steps and answers with its outcome.

No service blocks the node's other callbacks. If the answer depends on a later step, it is sent after that step.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

from std_srvs.srv import SetBool, Trigger

from gdfe_ros.checkpoint import load_state, save_state, write_state
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import ServiceSpec, services
from gdfe_ros.node.managed import ManagedNode
from gdfe_ros.node.parameters import NodeParameters
from gdfe_ros.node.refusals import Refused, ResultCode
from gdfe_ros.node.session import SimulationSession
from gdfe_ros.recording.step import Begin
from gdfe_ros.regular_file import read_bytes
from gdfe_ros.simulation import Simulation


class SessionNode(ManagedNode):
    """A node with the session of a simulation.

    Attributes:
        session: the parts of the configured node; None before it is configured.
    """

    session: SimulationSession | None = None

    def configured(self) -> SimulationSession:
        """Return the session.

        Raises:
            Refused: the node is not configured.
        """
        if self.session is None:
            text = "the node is unconfigured; call the transition `configure` first"
            raise Refused(ResultCode.INCORRECT_STATE, text)
        return self.session

    def active(self) -> SimulationSession:
        """Return the session, whose stepping runs.

        Raises:
            Refused: the node is not active.
        """
        session = self.configured()
        if not session.stepper.running:
            raise Refused(ResultCode.INCORRECT_STATE, "the node is not active; call the transition `activate` first")
        return session


class Services:
    """Offers the node's services; after a failure they answer ``success: false`` and the reason.

    Args:
        node: node of the services.
        parameters: parameters of the node.
    """

    def __init__(self, node: SessionNode, parameters: NodeParameters) -> None:
        self._node, self._parameters = node, parameters
        actions: dict[ServiceSpec, Callable[[Any], str | Future[str]]] = {
            services.RESET: self._reset,
            services.RESET_COMMANDS: lambda _: self._post(SimulationSession.reset_commands),
            services.RESET_BODIES: lambda _: self._post(SimulationSession.reset_bodies),
            services.RESET_SHAPE: self._reset_shape,
            services.RESET_ARMS: self._reset_arms,
            services.PAUSE: self._pause,
            services.STEP: self._step,
            services.RECORD: self._record,
            services.SAVE_STATE: self._save_state,
            services.LOAD_STATE: self._load_state,
            services.COMPUTE_JACOBIAN: self._compute_jacobian,
        }
        node.offer({spec: lambda request, _, action=action: action(request) for spec, action in actions.items()})

    def _reset(self, request: Trigger.Request) -> Future[str]:
        session = self._node.configured()
        session.interrupt("~/reset ended it")
        return session.stepper.post(session.reset, urgent=True)

    def _post(self, reset: Callable[[SimulationSession], str]) -> Future[str]:
        session = self._node.configured()
        return session.stepper.post(partial(reset, session))

    def _reset_shape(self, request: Trigger.Request) -> Future[str]:
        reset = Simulation.reset_shape
        return self._reset_part(services.RESET_SHAPE, reset, "the shape was reset", "at the rest shape")

    def _reset_arms(self, request: Trigger.Request) -> Future[str]:
        reset, done = Simulation.reset_arms, "the arms are at their initial positions"
        return self._reset_part(services.RESET_ARMS, reset, "the arms were reset", done)

    def _reset_part(self, spec: ServiceSpec, reset: Callable[[Simulation], None], why: str, done: str) -> Future[str]:
        """Reset a part between two steps, as soon as possible; the answer is the text ``done`` and the time."""
        session = self._node.configured()
        session.interrupt(f"{spec.name} ended it")

        def reset_now() -> str:
            session.continue_from(lambda: reset(session.simulation), why)
            return f"{done}, time {session.simulation.time:.9g} s"

        return session.stepper.post(reset_now, urgent=True)

    def _pause(self, request: SetBool.Request) -> str:
        session = self._node.active()
        if not request.data:
            session.play()
            return "running"
        session.interrupt("~/pause ended it")
        session.stepper.pause(True)
        return "paused"

    def _step(self, request: Trigger.Request) -> Future[str]:
        session = self._node.active()
        return session.take_steps(self._parameters["step_count"])

    def _record(self, request: SetBool.Request) -> Future[str]:
        session = self._node.active()
        return session.stepper.post(lambda: session.record(request.data), "beginning or finishing a bag")

    def _save_state(self, request: Trigger.Request) -> Future[str]:
        session, path = self._node.configured(), self._state_path()

        def save() -> str:
            data = save_state(session.simulation)
            try:
                write_state(path, data)
            except (OSError, ValueError) as error:
                raise GdfeError(f"state_path {path} cannot be written: {error}") from error
            return f"state at time {session.simulation.time:.9g} s in {path}"

        return session.stepper.post(save, "saving the state")

    def _load_state(self, request: Trigger.Request) -> Future[str]:
        session, path = self._node.configured(), self._state_path()
        session.interrupt("~/load_state ended it")

        def load() -> str:
            session.bags.require_none()
            try:
                data = read_bytes(path)
            except (OSError, ValueError) as error:
                text = f"state_path {path} cannot be read: {error}; remedy: the file that ~/save_state wrote"
                raise GdfeError(text) from error
            load_state(session.simulation, data)
            session.stepper.restart(Begin.LOADED)
            session.inputs.give_up("another state was loaded")
            session.flush()
            return f"state of {path}, time {session.simulation.time:.9g} s"

        return session.stepper.post(load, "loading a state", urgent=True)

    def _state_path(self) -> Path:
        if not self._parameters["state_path"]:
            raise GdfeError("parameter state_path is empty; set it to the file of the state")
        return Path(self._parameters["state_path"])

    def _compute_jacobian(self, request: Trigger.Request) -> Future[str]:
        session = self._node.active()
        scene = session.scene
        if not scene.actuators or not scene.probes:
            missing = "actuators" if not scene.actuators else "probes"
            raise GdfeError(f"scene {scene.name!r} has no {missing}; ~/jacobian is d probe / d actuator")

        def compute() -> str:
            found = session.simulation.jacobian(interrupted=session.stepper.must_end)
            session.outputs.publish_jacobian(found, session.run.log_time)
            return f"{len(scene.probes)} probes, {len(scene.actuators)} actuators"

        return session.stepper.post(compute, "computing the Jacobian")
