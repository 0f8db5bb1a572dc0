# SPDX-License-Identifier: Apache-2.0
"""The lifecycle node ``gdfe_sim`` and its transitions."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Mapping
from typing import Any

from lifecycle_msgs.msg import State
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.diagnostics import Diagnostics
from gdfe_ros.node.driving.remodelling import build_simulation, take_over
from gdfe_ros.node.interface import NODE_NAME, PARAMETERS, topics
from gdfe_ros.node.messages import pack_refusal
from gdfe_ros.node.middleware.channel import Channel
from gdfe_ros.node.parameters import NodeParameters, read_moduli
from gdfe_ros.node.refusals import Refusal, RefusalLog
from gdfe_ros.node.requests.entities import Entities, EntityQueries, SceneExchange
from gdfe_ros.node.requests.services import Services, SessionNode, Worlds
from gdfe_ros.node.requests.standard import StandardServices, TrajectoryAction
from gdfe_ros.node.simulation_session import SimulationSession
from gdfe_ros.recording.step import Begin
from gdfe_ros.scene.loader import load_scene
from gdfe_ros.scene.override import read_overrides
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Simulation

_DIAGNOSTICS_PERIOD = 1.0
"""Interval of the statuses on /diagnostics [s]."""
AUTOSTART_FAILED = 1
"""Exit status of a node that ends because `autostart` failed."""
_GREETING_PERIOD = 0.2
"""Longest time until a late subscriber gets the present state of an idle node [s]."""
_RECONNECTION = 1.0
"""Longest wait [s] for other nodes to reconnect to topics that were closed and opened again."""


class SimNode(SessionNode):
    """Lifecycle node with a soft-robot simulation, commanded and published on topics.

    It can be added to any executor of rclpy; a multi-threaded one runs its callbacks one at a time.

    Args:
        interrupted: event that is set by a request to end the process; a long service then stops early.
        options: options of ``rclpy.node.Node``: ``namespace``, ``context``, ``parameter_overrides``, ...

    Attributes:
        refusals: counts refused commands by reason.

    Raises:
        GdfeError: a parameter has a value that is not allowed.
    """

    def __init__(self, interrupted: threading.Event | None = None, **options: Any) -> None:
        super().__init__(NODE_NAME, **options)
        self.status = 0
        self._problem = ""
        self._settings = NodeParameters(self, changed=self._wake)
        logger = self.get_logger()
        self._refused = Channel(self, topics.REFUSED)
        self.refusals = RefusalLog(logger.warning, self._tell_refusal)
        self._diagnostics = Diagnostics(self, self.refusals)
        self._interrupted = interrupted or threading.Event()
        Services(self, self._settings)
        self._entities = Entities(self, SceneExchange(self, self._replace))
        EntityQueries(self, self._entities)
        self._starts_paused = False
        worlds = Worlds(self, load=self._load, unload=self._unload)
        self._standard = StandardServices(self, self._entities, worlds, interrupted)
        self._trajectories = TrajectoryAction(self)
        # A steady clock, because with use_sim_time the ROS clock may stand still.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._report, clock=self._steady)
        self.create_timer(_GREETING_PERIOD, self._greet, clock=self._steady)
        self._starter = None
        if self._settings["autostart"]:
            self._starter = self.create_timer(0.0, self._autostart, clock=self._steady)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the scene, factor matrices, compile kernels and open the topics; on failure, log every defect."""
        return self._attempt("configure", self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start stepping."""
        super().on_activate(state)
        outcome = self._attempt("activate", self._activate)
        if outcome is not TransitionCallbackReturn.SUCCESS:
            super().on_deactivate(state)
        return outcome

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop stepping and finish the bag; the simulation keeps its state."""
        self.session.stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Finish the bag, drop the simulation and close its topics; after that the node can be configured again."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_error = on_cleanup

    def close(self) -> None:
        """End the threads, finish the bag, drop the simulation; safe to call at any time."""
        self.await_preparation()
        self._entities.forget()
        session, self.session = self.session, None
        if session is not None:
            session.stop()
            session.close()
            del session
            self.collect()

    def destroy_node(self) -> None:
        """Close and destroy the node. Without `close`, its threads and topics would keep it in the ROS graph."""
        self.close()
        super().destroy_node()

    def prepare(self) -> Simulation:
        """Load the scene with its overrides and moduli, factor its matrices and compile the kernels.

        Raises:
            GdfeError: the scene or the overrides have defects; the text lists all of them.
        """
        name = self._settings["scene"]
        self.get_logger().info(
            f"configuring scene {name!r}; kernels that no scene has used before are compiled first, "
            "which may take a minute"
        )
        overrides = read_overrides(self._settings.entries("scene_overrides"), "parameter scene_overrides")
        scene = load_scene(name, overrides=overrides)
        if moduli := read_moduli(self.given_parameters, scene):
            scene = load_scene(name, overrides={**overrides, **moduli})
        return build_simulation(scene)

    def _configure(self) -> None:
        prepared, self.prepared = self.prepared or self.prepare(), None
        if isinstance(prepared, Exception):
            raise prepared
        self.session = SimulationSession(self, self._settings, prepared, self.refusals, ending=self._interrupted)
        scene = self.session.scene
        named: dict[str, list[str]] = {"handles": []}
        for handle in scene.handles:
            named.setdefault(handle.section, []).append(handle.name)
        parts = [f"{section} {', '.join(names) or 'none'}" for section, names in named.items()]
        size = f"{scene.mesh.n_vertices} vertices, {scene.mesh.n_cells} cells"
        self.get_logger().info(f"scene {scene.name!r}: {', '.join([size, *parts])}")
        for remark in self.session.run.frames.remarks() if self._settings["publish_tf"] else ():
            self.get_logger().warning(remark)

    def _replace(self, simulation: Simulation, before: Scene, anew: bool) -> bool:
        """Replace the session by one of ``simulation``: at rest if ``anew``, else in the present motion.

        Return False, and keep the session, if its scene is no longer ``before``.

        Raises:
            GdfeError: a new body overlaps something; the session goes on.
        """
        old = self.session
        known, handover = old.connections(), old.halt()
        try:
            if old.scene is not before:
                return False
            if not anew:
                take_over(old.simulation, simulation)
            old.close()
            try:
                self.session = self._open(simulation, old, anew=anew)
            except Exception:
                self.session = self._open(old.simulation, old, anew=False)
                raise
            self._await_connections(known)
            return True
        finally:
            if handover is not None:
                super().on_activate(LifecycleState(State.PRIMARY_STATE_ACTIVE, "active"))
                self.session.start(handover)

    def _open(self, simulation: Simulation, old: SimulationSession, *, anew: bool) -> SimulationSession:
        """Return a session of ``simulation`` in place of the closed session ``old``."""
        session = SimulationSession(self, self._settings, simulation, self.refusals, ending=self._interrupted)
        session.stepper.restart(Begin.REST if anew else Begin.LOADED)
        if anew:
            old.inputs.give_up("the simulation was reset")
        else:
            session.take_over(old)
        return session

    def _await_connections(self, known: Mapping[str, int]) -> None:
        """Wait, at most `_RECONNECTION`, until the new topics have as many connected endpoints as the old ones had."""
        end = time.monotonic() + _RECONNECTION
        while time.monotonic() < end:
            now = self.session.connections()
            if all(now.get(topic, count) >= count for topic, count in known.items()):
                return
            time.sleep(0.002)

    def _load(self, simulation: Simulation) -> None:
        """Drop the present session, and start one of ``simulation``, paused at time 0.

        Raises:
            GdfeError: a transition failed; the text includes its error.
        """
        self._unload()
        self.prepared, self._starts_paused = simulation, True
        try:
            for change in (self.trigger_configure, self.trigger_activate):
                if change() is not TransitionCallbackReturn.SUCCESS:
                    raise GdfeError(f"the present scene is gone, and {self._problem}")
        finally:
            self._starts_paused = False
        self._standard.stop_at_start()

    def _unload(self) -> None:
        """Drop the present session, if any, by the transitions deactivate and cleanup."""
        if self.lifecycle_state == "active":
            self.trigger_deactivate()
        if self.lifecycle_state == "inactive":
            self.trigger_cleanup()

    def _activate(self) -> None:
        self.session.start(paused=self._starts_paused)
        held = [each for each in self.session.scene.handles if each.fixed and each.section in topics.VELOCITY_COMMANDS]
        fixed = tuple(f"{each.section}/{each.name}/" for each in held)
        inputs = ", ".join(f"~/{key}" for key in self.session.inputs.keys if not key.startswith(fixed))
        self.get_logger().info(f"active, clock {self.session.mode.value}; takes commands on {inputs or 'no topic'}")

    def _attempt(self, name: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        """Execute a transition and return its code; exceptions are logged here, because rclpy does not show them."""
        self._problem = ""
        try:
            action()
        except (GdfeError, OSError) as error:  # a path may be too long, forbidden, or on a disk that is full
            self._problem = f"{name} failed: {error}"
            self.get_logger().error(self._problem)
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self._problem = f"{name} failed: {error!r}"
            self.get_logger().error(f"{self._problem}\n{traceback.format_exc()}")
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _autostart(self) -> None:
        starter, self._starter = self._starter, None
        if starter is None:  # EventsExecutor may have queued the timer's callback several times
            return
        self.destroy_timer(starter)
        if self.lifecycle_state == "unconfigured":  # another client may have configured it already
            self.configure_later().add_done_callback(lambda done: self._activate_after(done.result()))

    def _activate_after(self, configured: TransitionCallbackReturn) -> None:
        if configured is TransitionCallbackReturn.SUCCESS:
            if self.trigger_activate() is TransitionCallbackReturn.SUCCESS:
                return
            self.get_logger().error("autostart: the node is configured, but could not be activated")
        if self._settings["required"]:
            self.get_logger().error("autostart failed; the process ends, because the parameter `required` is true")
            self.status = AUTOSTART_FAILED
            self._interrupted.set()
        elif configured is not TransitionCallbackReturn.SUCCESS:
            self.get_logger().error(
                "autostart failed; the node keeps running, unconfigured. Correct the parameters, then: "
                f"gdfe lifecycle {self.get_fully_qualified_name()} configure, then activate; "
                "the parameter `required` ends the process instead"
            )

    def _tell_refusal(self, source: str, refusal: Refusal, late: bool) -> None:
        """Publish a refusal for clients that wait for the step of the refused command."""
        if self._refused.wanted:
            self._refused.send(pack_refusal(source, refusal, late=late), 0)

    def _wake(self) -> None:
        """Apply changed parameters to the wait for the next step."""
        if self.session is not None:
            self.session.stepper.wake()

    def _greet(self) -> None:
        session = self.session  # another thread may call `close`
        if session is not None:
            session.greet()

    def _report(self) -> None:
        self.turn()
        session = self.session  # another thread may call `close`
        if session is not None:
            session.look()
        self._diagnostics.publish(session, self.lifecycle_state, self._problem)


_HELP = """usage: sim_node [--help] [--ros-args ...]

The soft-robot simulation gdfe_sim, a ROS 2 lifecycle node. It takes ROS arguments only:

  sim_node --ros-args -p scene:=tendon_finger -p clock:=lockstep -r __ns:=/robot --params-file my.yaml

parameters (docs/node.md says more):
"""


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; the entry point of ``sim_node``."""
    from gdfe_ros.node.middleware.process import answer_arguments, run

    lines = [f"  {spec.name:<18}{spec.meaning} [{spec.default!r}]" for spec in PARAMETERS]
    answered = answer_arguments("sim_node", _HELP + "\n".join(lines), args)
    return run(SimNode, args) if answered is None else answered
