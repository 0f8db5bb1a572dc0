# SPDX-License-Identifier: Apache-2.0
"""A twin follows another node as the real robot, of another modulus, noisy and late, and finds its modulus."""

from __future__ import annotations

import csv
import math
import re
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from gdfe_ros.errors import GdfeError
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Simulation
from gdfe_ros.twin.estimator import ModulusEstimator, ProbeComparison, Sample
from gdfe_ros.twin.remote.robot import Robot
from gdfe_ros.twin.twin import Twin

ARM = """
name: arm
mesh: {bar: {size: [0.12, 0.02, 0.02], cells: [12, 2, 2]}}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {tendon: {cable: {points: [[0.0, 0.0, 0.008], [0.12, 0.0, 0.008]], range: [0.0, 5.0]}}}
probes: {middle: [0.06, 0.0, 0.0], tip: [0.12, 0.0, 0.0]}
"""
"""An arm that one tendon bends."""
TIP = np.array([0.12, 0.0, 0.0])
"""Where the probe is at rest [m]."""
REAL = 1.5e5
"""Young's modulus of the real robot [Pa]; the twin begins with 1.0e5."""
HELD = 1.5
"""Time for which a command is held [s]."""
NOISE, DELAY, DURATION = 5e-4, 0.04, 20.0
"""Noise of the measured positions [m], delay of their messages [s], and time that the twin has [s]."""


class _Relay:
    """Passes the robot's tip on, noisy and late, as a camera would, and commands the robot."""

    def __init__(self, client: Any) -> None:
        self._random, self._late = np.random.default_rng(0), deque()
        node = client.node
        self._measured = node.create_publisher(PoseStamped, "/camera/tip", qos_profile_sensor_data)
        self._commands = node.create_publisher(JointState, client.full("actuation"), 10)
        node.create_subscription(PoseStamped, client.full("probe/tip"), self._take, 10)
        node.create_timer(0.005, self._pass_on)
        node.create_timer(0.1, self._command)
        self._start = time.monotonic()

    def _take(self, message: PoseStamped) -> None:
        place = message.pose.position
        for axis, error in zip("xyz", self._random.normal(0.0, NOISE, 3), strict=True):
            setattr(place, axis, getattr(place, axis) + float(error))
        self._late.append((time.monotonic() + DELAY, message))

    def _pass_on(self) -> None:
        while self._late and self._late[0][0] <= time.monotonic():
            self._measured.publish(self._late.popleft()[1])

    def _command(self) -> None:
        tension = (0.5, 2.0, 1.0, 1.5)[int((time.monotonic() - self._start) / HELD) % 4]
        self._commands.publish(JointState(name=["tendon"], effort=[float(tension)]))


def test_the_modulus_of_another_node_is_found_online(client: Any, launch: Callable, tmp_path: Path) -> None:
    """Two processes: the robot is half as stiff again, noisy and 40 ms late; after 20 s the error is below 5 %."""
    scene, table = tmp_path / "arm.yaml", tmp_path / "twin.csv"
    scene.write_text(ARM)
    launch(
        scene=str(scene),
        scene_overrides=[f"materials.soft.young={REAL:g}"],
        clock="wall",
        rate=25.0,
        dt=0.04,
        slew_time=0.0,
    )
    relay = _Relay(client)
    command = [str(Path(sys.executable).with_name("gdfe")), "twin", str(scene), "--topics", "tip=/camera/tip"]
    options = ["--fit", "soft", "--noise", str(1e3 * NOISE), "--record", str(table), "--port", "0"]
    process = subprocess.Popen(
        [*command, *options, "--seconds", str(DURATION), "--patience", "120"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        client.wait(lambda: process.poll() is not None, seconds=200.0)
        output = process.stdout.read()
    finally:
        process.kill()
        process.wait()
    del relay
    assert process.returncode == 0, output
    young = float(re.search(r"end: .*soft ([0-9.e+]+) Pa", output).group(1))
    assert young == pytest.approx(REAL, rel=0.05), output
    rows = list(csv.DictReader(table.open(encoding="utf-8")))
    distances = np.array([float(row["distance [m]"]) for row in rows])
    ways = np.array([np.linalg.norm([float(row[f"measured {axis} [m]"]) for axis in "xyz"] - TIP) for row in rows])
    # A modulus within 5 % puts the tip within 5 % of its way.
    allowed = 0.05 * ways + 4.0 * NOISE
    assert len(rows) > 100
    fifth = len(rows) // 5
    assert np.median(distances[-fifth:] / allowed[-fifth:]) < 1.0 < (distances / allowed)[:fifth].max()


def test_least_squares_find_the_logarithms_of_moduli() -> None:
    """With linear measurements the estimate is exact up to the prior, also if corrections are taken in parts."""
    random, truth = np.random.default_rng(1), np.array([0.4, -0.3])
    estimator, taken = ModulusEstimator(2), np.zeros(2)
    for number in range(400):
        rows = random.normal(size=(3, 2))
        noise = random.normal(0.0, 1e-3, 3)
        estimator.add(0.01 * number, rows @ (truth - taken) + noise, rows, 1e-3)
        if number % 50 == 49:
            step = 0.5 * estimator.correction
            estimator.settle(step)
            taken = taken + step
    assert taken + estimator.correction == pytest.approx(truth, abs=5e-4)
    assert (estimator.deviations < 1e-4).all()


def test_measurements_meet_the_state_of_their_time() -> None:
    """States are interpolated and spread over the window; a measurement waits, and an idle simulation stays."""
    comparison, still = ProbeComparison(0.1, 0.06), np.zeros(3)
    for number in range(3):
        place = {"tip": np.array([float(number), 0.0, 0.0])}
        comparison.add(Sample(stamp=10.0 + 0.1 * number, places=place, derivatives=None))
    comparison.measure(10.15, "tip", still)
    comparison.measure(10.3, "tip", still)
    (first,) = comparison.pairs(10.4, idle=False)
    assert (first.simulated[0], first.spread) == (pytest.approx(1.5), pytest.approx(1.5))
    (second,) = comparison.pairs(10.4, idle=True)
    assert (second.distance, second.spread) == (pytest.approx(2.0), 0.0)
    comparison.measure(9.0, "tip", still)
    assert comparison.pairs(20.0, idle=True) == []


def test_unsuitable_scenes_are_refused() -> None:
    """A material without a modulus, and a scene without probes, are named."""
    simulation = Simulation(scene_from_text(ARM))
    with pytest.raises(GdfeError, match="'sof' has no Young's modulus to fit; did you mean 'soft'"):
        Twin(simulation, moduli=["sof"])
    bare = Simulation(scene_from_text(ARM.partition("probes")[0]))
    with pytest.raises(GdfeError, match="has no probes"):
        Twin(bare)


def _stamped(at: float, x: float = 0.12, frame: str = "") -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = int(at), int(at % 1.0 * 1e9)
    message.pose.position.x = x
    return message


def test_what_a_robot_sends_wrongly_is_refused_with_its_reason(ros: Any) -> None:
    """NaN, far places, other clocks, unknown commands and large messages change nothing; each has one warning."""
    texts: list[str] = []
    twin = Twin(Simulation(scene_from_text(ARM)), moduli=["soft"], noise=1.0, warn=texts.append)
    node = ros.node("camera")
    poses = node.create_publisher(PoseStamped, "/camera/tip", 100)
    orders = node.create_publisher(JointState, "/robot/orders", 100)
    robot = Robot(twin, commands="/robot/orders", measured={"tip": "/camera/tip"}, patience=60.0, warn=texts.append)
    try:
        twin.start()
        while not (poses.get_subscription_count() and orders.get_subscription_count() and twin.session.last):
            time.sleep(0.05)
        wrong = [_stamped(0.0, x) for x in (math.nan, math.inf, 1e300, 2.0)]
        for message in (*wrong, *(_stamped(time.time() - late) for late in (-60.0, 60.0, 1e6))):
            poses.publish(message)
            time.sleep(0.1)  # the subscription keeps the last five
        orders.publish(JointState(name=["tendon"], effort=[math.inf]))
        orders.publish(JointState(name=["jaw"], effort=[1.0]))
        orders.publish(JointState(name=["tendon" * 200000], effort=[1.0]))
        end = time.monotonic() + 60.0
        while twin.compared < 3:
            assert time.monotonic() < end, texts
            poses.publish(_stamped(0.0, 0.1201, "camera"))
            time.sleep(0.1)
            twin.update()
    finally:
        robot.close()
        twin.stop()
    assert np.linalg.norm(twin.latest["tip"].measured) == pytest.approx(0.1201)
    assert twin.moduli["soft"] == pytest.approx(1e5)
    for reason in (
        "must be finite",
        "1e+300 m from rest; allowed: 1.23 m",
        "after this machine's clock; allowed: 5 s",
        "before this machine's clock; allowed: 5 s",
        "actuator 'tendon': tension inf is not finite",
        "no actuator jaw",
        "bytes; allowed: up to 1000000",
        "have the frame 'camera'",
    ):
        assert sum(reason in text for text in texts) == 1, (reason, texts)


def test_a_modulus_that_was_not_taken_is_not_counted_as_taken(tmp_path: Path) -> None:
    """While a bag of the page is written, moduli stay; the deviations that ask for another one are not forgotten."""
    texts: list[str] = []
    twin = Twin(Simulation(scene_from_text(ARM)), moduli=["soft"], warn=texts.append)
    twin._estimator.add(0.0, [0.0, 0.0, 0.01], [[0.0], [0.0], [-0.02]], 1e-3)
    wanted = twin._estimator.correction.copy()
    twin.start()
    try:
        twin.session.record(tmp_path / "bag").result(timeout=60.0)
        twin.update()
        twin._change[0].exception(timeout=60.0)
        twin._changed = math.inf  # no second trial
        twin.update()
    finally:
        twin.stop()
    assert any("the moduli were not changed: a bag is being written" in text for text in texts)
    assert twin._estimator.correction == pytest.approx(wanted)
