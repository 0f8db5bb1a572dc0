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
from gdfe_ros.simulation import Command, Simulation
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
ARM_OF_TWO = ARM.replace(
    "}}\nregions: [", "}, hard: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}\nregions: ["
).replace("{material: soft}]", "{material: soft}, {material: hard, where: {box: {x: [0.0, 0.06]}}}]")
"""The arm with another material in its first half."""
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


def test_measurements_before_a_large_correction_do_not_distort_the_estimate() -> None:
    """If positions are not linear in the logarithms, the estimate is within three of its standard deviations."""
    random, truth = np.random.default_rng(2), np.array([0.4, 1.2])
    estimator, taken = ModulusEstimator(2), np.zeros(2)
    for number in range(200):
        weights = random.uniform(0.01, 0.05, (3, 2))
        deviation = weights @ (np.exp(-truth) - np.exp(-taken)) + random.normal(0.0, 1e-4, 3)
        estimator.add(0.1 * number, deviation, -weights * np.exp(-taken), 1e-4)
        if number % 10 == 9:
            step = estimator.correction
            step = min(1.0, 0.5 / np.abs(step).max()) * step
            estimator.settle(step)
            taken = taken + step
    assert (np.abs(taken - truth) < 3.0 * estimator.deviations).all()
    assert (estimator.deviations < 3e-3).all()


def test_a_misfit_increases_the_standard_deviation() -> None:
    """Deviations of ten times the assumed noise that no modulus explains make the standard deviation ten times."""
    expected, found = ModulusEstimator(1), ModulusEstimator(1)
    for number in range(100):
        for estimator, size in ((expected, 0.5e-3), (found, 10e-3)):
            estimator.add(0.0, [(-1) ** number * size, size, -size], [[0.1], [0.1], [0.1]], 1e-3)
    assert found.deviations == pytest.approx(10.0 * expected.deviations, rel=0.02)


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


def _comparison(noise: float) -> ProbeComparison:
    """Return a comparison with a window of 0.3 s and a simulated probe that rests at 0."""
    comparison = ProbeComparison(0.02, 0.3, noise)
    comparison.add(Sample(stamp=0.0, places={"tip": np.zeros(3)}, derivatives={"tip": np.ones((3, 1))}))
    return comparison


def _measure(comparison: ProbeComparison, places: dict[float, float]) -> None:
    for stamp, x in places.items():
        comparison.measure(stamp, "tip", np.array([x, 0.0, 0.0]))


def test_motions_after_a_measurement_count() -> None:
    """A measurement waits for the window; a step that ends or only begins in the window then counts as a motion."""
    comparison, moved = _comparison(1e-4), {"tip": np.array([0.01, 0.0, 0.0])}
    _measure(comparison, {1.0: 0.0, 1.5: 0.0})
    assert comparison.pairs(1.2, idle=True) == []
    comparison.add(Sample(stamp=2.0, places=moved, derivatives=None, duration=0.55))
    assert [each.spread for each in comparison.pairs(2.0, idle=True)] == [0.0, pytest.approx(0.01)]


def test_a_measurement_waits_for_the_step_after_it() -> None:
    """While the simulation moves, measurements after its last state less the window are not compared."""
    comparison = _comparison(1e-4)
    _measure(comparison, {0.5: 0.0})
    assert comparison.pairs(2.0, idle=False) == []
    comparison.add(Sample(stamp=0.9, places={"tip": np.zeros(3)}, derivatives=None))
    assert len(comparison.pairs(2.0, idle=False)) == 1


def test_a_robot_that_moves_alone_says_nothing_about_its_modulus() -> None:
    """While only the robot moves, measurements have a spread and no derivatives; noise does not count as motion."""
    random, comparison = np.random.default_rng(3), _comparison(1e-3)
    stamps = 1.0 + 0.02 * np.arange(300)
    slewed = 0.05 * np.clip(stamps - 3.0, 0.0, 1.0) + random.normal(0.0, 1e-3, 300)
    _measure(comparison, dict(zip(stamps.tolist(), slewed.tolist(), strict=True)))
    found = comparison.pairs(5.9, idle=True)
    moving = [each for each in found if 3.05 < each.stamp < 3.95]
    still = [each for each in found if not 2.7 < each.stamp < 4.3]
    assert all(each.derivatives is None and each.spread > 1e-3 for each in moving)
    assert len(moving) == 45
    assert np.mean([each.derivatives is not None and each.spread == 0.0 for each in still]) > 0.98


def test_states_of_earlier_moduli_are_discarded() -> None:
    """After a change of moduli, no measurement is compared with a state of the earlier moduli."""
    twin = Twin(Simulation(scene_from_text(ARM)), moduli=["soft"])
    twin.start()
    try:
        twin.session.set_moduli({"soft": 1.2e5}).result(timeout=60.0)
    finally:
        twin.stop()
    assert len(twin._comparison._samples) == 1


def test_an_exact_model_finds_the_moduli_within_their_standard_deviations() -> None:
    """Without noise, a slewed robot in held poses gives both moduli within three of the stated standard deviations."""
    scene, real = ARM_OF_TWO, {"soft": 1.5e5, "hard": 2.5e5}
    plant = Simulation(scene_from_text(scene, overrides={f"materials.{name}.young": real[name] for name in real}))
    twin = Twin(Simulation(scene_from_text(scene)), moduli=list(real), noise=1e-4)
    twin.start()
    end, tension = time.monotonic() + 120.0, 0.0
    try:
        while max(twin.deviations.values()) > 0.01:
            assert time.monotonic() < end, (twin.moduli, twin.deviations)
            start, tension = tension, 1.5 if tension == 0.5 else 0.5
            twin.command({"tendon": tension})
            for present in (*np.linspace(start, tension, 8).tolist(), *[tension] * 60):
                plant.step(Command(actuators={"tendon": present}))
                for probe, place in plant.probe_positions().items():
                    twin.measure(time.time(), probe, place)
                time.sleep(0.02)
                twin.update()
    finally:
        twin.stop()
    for name, young in twin.moduli.items():
        assert abs(math.log(young / real[name])) < 3.0 * twin.deviations[name], (twin.moduli, twin.deviations)


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
