# SPDX-License-Identifier: Apache-2.0
"""The harness for tests of controllers: real processes, closed loops, the same bits."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import CommandError, GdfeError, OverlapError
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.testing import PublishedState, Simulator, tracking_error
from gdfe_ros.testing.client import STATE_QOS

COARSE = {"mesh.bar.cells": [20, 2, 2]}
GOAL = 0.1


def _controller(state: PublishedState) -> Command:
    """Push the tip half of the distance to the goal."""
    height = state.poses["tip"].translation[2]
    return Command(handles={"tip": Pose((0.0, 0.0, height + 0.5 * (GOAL - height)))})


def test_a_controller_reaches_its_goal() -> None:
    """A controller reaches its goal within 30 steps."""
    with Simulator("bend5", overrides=COARSE) as simulator:
        states = simulator.run(_controller, steps=30)
    heights = [[0.0, 0.0, state.poses["tip"].translation[2]] for state in states]
    assert tracking_error(heights[20:], [0.0, 0.0, GOAL]).largest < 1e-5


def test_a_controller_of_a_body_in_motion_reads_velocities_and_inertial_units() -> None:
    """With dynamics, states have the velocities and IMU readings of a simulation here; without, they have none."""
    overrides = {"mesh.bar.cells": [10, 1, 1], "handles.base.fixed": False}
    commands = [Command(handles={"base": Pose((0.0, 0.0, 1e-3 * np.sin(0.5 * step)))}) for step in range(10)]
    same = Simulation(load_scene("drop", overrides=overrides))
    with Simulator("drop", overrides=overrides, parameters={"dt": 0.005}) as simulator:
        assert not simulator.state.velocities.any()
        for command in commands:
            state, result = simulator.step(command), same.step(command, dt=0.005)
            reading, expected = state.imus["tip"], same.imus()["tip"]
            np.testing.assert_array_equal(state.velocities, result.velocities.astype(np.float32))
            np.testing.assert_allclose(reading.angular_velocity, expected.angular_velocity, atol=1e-12)
            np.testing.assert_allclose(reading.linear_acceleration, expected.linear_acceleration, atol=1e-12)
            assert (reading.orientation.inv() * expected.orientation).magnitude() < 1e-12
    with Simulator("bend5", overrides=COARSE) as simulator:
        assert simulator.state.velocities is None
        assert simulator.state.imus == {}


def test_loads_are_commanded_and_replayed(tmp_path: Path, replays: Callable) -> None:
    """With a load reduced step by step, each state is that of a simulation here, and the bag replays through ROS."""
    overrides = {"mesh.bar.cells": [10, 1, 1], "dynamics": None, "handles.base.fixed": True}
    (load,) = load_scene("drop", overrides=overrides).loads
    same = Simulation(load_scene("drop", overrides=overrides))
    same.step(dt=0.0)  # the node begins in equilibrium
    with Simulator("drop", overrides=overrides, bag=tmp_path / "bag") as simulator:
        for factor in (0.1, 0.05, 0.2):
            state = simulator.step(Command(loads={load.name: factor}))
            expected = same.step(Command(loads={load.name: factor}), dt=state.record.dt)
            np.testing.assert_allclose(state.positions, expected.positions, atol=1e-7 * same.mesh.size)
    replays(tmp_path / "bag", node=True)


def test_a_scene_without_inputs_is_stepped() -> None:
    """A bar in motion without inputs can be stepped."""
    overrides = {"mesh.bar.cells": [10, 1, 1], "loads": {}, "program": None, "dynamics.velocity": [0.0, 0.0, 0.1]}
    with Simulator("drop", overrides=overrides) as simulator:
        assert [simulator.step().record.step for _ in range(3)] == [1, 2, 3]


def test_a_reset_by_somebody_else_is_not_taken_for_a_step() -> None:
    """After a reset by another client, a step returns its own command's state, not the reset's."""
    raised = Command(handles={"tip": Pose((0.0, 0.0, 0.01))})
    with Simulator("bend5", overrides=COARSE) as simulator:
        simulator.step(raised)
        other = Node("somebody_else", context=simulator.context)
        client = other.create_client(Trigger, f"{simulator.name}/reset")
        assert client.wait_for_service(60.0)
        future = client.call_async(Trigger.Request())
        executor = SingleThreadedExecutor(context=simulator.context)
        executor.add_node(other)
        executor.spin_until_future_complete(future, 60.0)
        assert future.result().success
        state = simulator.step(raised)
        other.destroy_node()
    assert state.poses["tip"].translation[2] == pytest.approx(0.01)
    assert state.time == pytest.approx(state.record.dt)


TWIST = {"mesh.bar.cells": [16, 1, 1], "solver.tolerance": 1e-8}


def test_a_handle_turns_on_and_on_as_in_a_direct_call() -> None:
    """Turns in steps below pi reach 4 rad as in a direct call, also after a refusal; larger steps are refused."""
    direct = Simulation(load_scene("bend5", overrides=TWIST))
    with Simulator("bend5", overrides=TWIST) as simulator:
        for angle, far in ((2.0, -2.0), (4.0, 0.0), (4.0, 7.5)):
            command = Command(handles={"tip": Pose(rotation=(angle, 0.0, 0.0))})
            state, expected = simulator.step(command), direct.step(command, dt=0.01)
            assert state.record.handles["tip"].rotation == pytest.approx((angle, 0.0, 0.0))
            assert state.poses["tip"].rotation == pytest.approx((angle, 0.0, 0.0))
            np.testing.assert_allclose(state.wrenches["tip"][3], expected.reactions["tip"][3], rtol=1e-3)
            told = (
                rf"handle 'tip' is commanded to turn by {abs(angle - far):g} rad in one step; allowed .* smaller steps"
            )
            with pytest.raises(CommandError, match=told):
                simulator.step(Command(handles={"tip": Pose(rotation=(far, 0.0, 0.0))}))
        with pytest.raises(CommandError, match="m from rest; allowed"):
            simulator.step(Command(handles={"tip": Pose(translation=(0.0, 100.0, 0.0), rotation=(4.0, 0.0, 0.0))}))
        assert simulator.step().poses["tip"].rotation == pytest.approx((4.0, 0.0, 0.0))


def test_a_wrong_name_leaves_the_commands_alone() -> None:
    """An unknown name and a fixed handle raise the error of a direct call, and the next step is made."""
    direct = Simulation(load_scene("bend5", overrides=COARSE))
    lift = Pose((0.0, 0.0, 0.01))
    wrong = (
        Command(loads={"wind": 1.0}), Command(actuators={"motor": 1.0}), Command(handles={"tpi": lift}),
        Command(handles={"base": lift}), Command(bodies={"part": lift}),
    )  # fmt: skip
    with Simulator("bend5", overrides=COARSE) as simulator:
        for command in wrong:
            with pytest.raises(CommandError) as told:
                direct.step(command)
            with pytest.raises(CommandError, match=re.escape(str(told.value))):
                simulator.step(command)
        assert simulator.step().record.step == 1


def test_a_refused_command_is_raised_at_once_and_forgotten() -> None:
    """A pose a kilometre away raises the error of a direct call at once, and the next step is made."""
    direct = Simulation(load_scene("bend5", overrides=COARSE))
    far, good = (Command(handles={"tip": Pose((0.0, 0.0, z))}) for z in (1e3, 0.01))
    with pytest.raises(CommandError) as told:
        direct.step(far)
    with Simulator("bend5", overrides=COARSE) as simulator:
        begun = time.monotonic()
        for _ in range(2):
            with pytest.raises(CommandError, match=re.escape(str(told.value))):
                simulator.step(far)
        assert time.monotonic() < begun + 2.0
        assert simulator.step(good).poses["tip"].translation[2] == pytest.approx(0.01)


def test_what_only_the_node_refuses_is_raised_at_once() -> None:
    """A step that only the node refuses, because it is inactive or follows a topic, raises at once."""
    with Simulator("tendon_finger", patience=60.0) as simulator:
        flexor = Command(actuators={"flexor": 0.5})
        simulator.step(flexor)
        simulator._client.transition("deactivate")
        with pytest.raises(CommandError, match="actuation refused: the node is not active"):
            simulator.step(flexor)
    following = {"follow": ["tip=topic:/lead"]}
    told = pytest.raises(CommandError, match="follows topic /lead")
    with Simulator("bend5", overrides=COARSE, parameters=following, patience=60.0) as simulator, told:
        simulator.step()


def test_a_body_put_inside_another_raises(slab: Path) -> None:
    """A box put into a table raises the error of a direct call, and the next step is made."""
    inside, above = (Command(bodies={"part": Pose((0.0, 0.0, z))}) for z in (-0.05, 0.05))
    with pytest.raises(OverlapError) as told:
        Simulation(load_scene(slab)).step(inside)
    with Simulator(slab, parameters={"dt": 0.02}, patience=60.0) as simulator:
        with pytest.raises(OverlapError, match=re.escape(str(told.value)[:40])):
            simulator.step(inside)
        assert simulator.step(above).poses["part"].translation[2] > 0.04


class _Follower(Node):
    """A controller node that raises the tip by a millimetre with every mesh."""

    def __init__(self, simulator: Simulator) -> None:
        super().__init__("follower", context=simulator.context)
        self.step = 0
        self._known = False
        self._publisher = self.create_publisher(PoseStamped, f"{simulator.name}/handles/tip/target", 10)
        self.create_subscription(PointCloud2, f"{simulator.name}/mesh", self._take, STATE_QOS)
        self.create_timer(0.1, self._begin)

    def _begin(self) -> None:
        if self._known and self.step == 0 and self._publisher.get_subscription_count():
            self._follow()

    def _take(self, _: Any) -> None:
        """Follow every mesh except the first; after it, the simulation knows this subscriber."""
        if self._known:
            self._follow()
        self._known = True

    def _follow(self) -> None:
        self.step += 1
        message = PoseStamped()
        message.pose.position.z = 1e-3 * self.step
        self._publisher.publish(message)


def test_a_node_closes_the_loop() -> None:
    """With a node that commands at every mesh, each command makes one step."""
    with Simulator("bend5", overrides=COARSE, inputs=[]) as simulator:
        follower = _Follower(simulator)
        states = simulator.spin(follower, steps=50)
        follower.destroy_node()
    np.testing.assert_allclose([state.poses["tip"].translation[2] for state in states], 1e-3 * np.arange(1, 51))


class _Talker(Node):
    """Commands a displacement [m] of the tip once it sees the mesh, on a topic of the simulation's node."""

    def __init__(self, simulator: Simulator, *, topic: str, height: float) -> None:
        super().__init__("talker", context=simulator.context)
        self._publisher = self.create_publisher(PoseStamped, f"{simulator.name}/{topic}", 10)
        self._height = height
        self.create_subscription(PointCloud2, f"{simulator.name}/mesh", self._see, STATE_QOS)

    def _see(self, mesh: PointCloud2) -> None:
        message = PoseStamped()
        message.pose.position.z = self._height
        if self._height:
            self._publisher.publish(message)


@pytest.mark.parametrize(
    ("topic", "height", "kind", "text"),
    [
        ("goals", 0.01, GdfeError, r"waits for a message on \S+/handles/tip/target, which no .* publishes \S*goals"),
        ("handles/tip/target", 0.0, GdfeError, r"waits for ~/handles/tip/target for 7 s, and no controller has sent"),
        ("handles/tip/target", 1e6, CommandError, r"handles/tip/target refused"),
    ],
)
def test_a_controller_that_closes_no_loop_is_given_up(topic: str, height: float, kind: type, text: str) -> None:
    """A node on another topic, one that is silent, and one whose command is refused end the spin, with the reason."""
    with Simulator("bend5", overrides=COARSE, inputs=["handles/tip/target"]) as simulator:
        talker = _Talker(simulator, topic=topic, height=height)
        with pytest.raises(kind, match=text):
            simulator.spin(talker, steps=3, silence=7.0)
        talker.destroy_node()


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    """An unknown handle, and a file in place of the bag, raise the node's own errors."""
    with Simulator("bend5", overrides=COARSE) as simulator, pytest.raises(CommandError, match="no handle 'tipp'"):
        simulator.step(Command(handles={"tipp": Pose()}))
    (tmp_path / "file").touch()
    with pytest.raises(GdfeError, match=r"could not activate:[\s\S]*not empty"), Simulator("bend5", bag=tmp_path):
        pass


def test_tracking_errors_are_distances() -> None:
    """Tracking errors of two short motions are the distances, and shapes that do not fit are refused."""
    error = tracking_error([[0, 0, 0], [0, 3, 4]], [0, 0, 0])
    assert (error.largest, error.rms, error.last) == (5.0, pytest.approx(np.sqrt(12.5)), 5.0)
    with pytest.raises(ValueError, match="must be"):
        tracking_error([0, 0, 0], [0, 0, 0])
    with pytest.raises(ValueError, match="finite"):
        tracking_error([[0, 0, np.nan]], [0, 0, 0])
