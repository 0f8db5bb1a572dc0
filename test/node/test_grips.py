# SPDX-License-Identifier: Apache-2.0
"""Grips over topics: attach and release by name, refusals, and bags that replay to the bit."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Point, Pose, PoseStamped, Twist, TwistStamped, Vector3
from std_msgs.msg import String

from gdfe_ros import Command
from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.errors import CommandError
from gdfe_ros.testing import Simulator

SCENE = """
name: cup
mesh: {bar: {size: [0.04, 0.02, 0.02], cells: [2, 1, 1]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
regions: [{material: m}]
handles: {base: {where: {face: x-}}}
bodies: {box: {box: {size: [0.02, 0.02, 0.02]}, mass: 0.1, at: [0.2, 0, 0]}}
obstacles: {hand: {box: {size: [0.02, 0.02, 0.01]}, at: [0.2, 0, 0.0151]}}
actuators: {cup: {grip: {to: hand, body: box}}}
dynamics: {step: 0.002, scheme: bdf2}
"""


def test_a_grip_is_attached_and_released_by_its_name(client: Any, launch: Callable, tmp_path: Path) -> None:
    """~/attach takes hold, ~/release lets go; wrong names and repetitions are refused; the bag replays to the bit."""
    (tmp_path / "cup.yaml").write_text(SCENE)
    given = {"scene": str(tmp_path / "cup.yaml"), "clock": "fast", "dt": 0.002, "heartbeat": 0.0, "step_count": 5}
    process = launch(**given, record=True, bag_path=str(tmp_path / "bag"))
    client.switch("pause", True)

    def told(count: int) -> None:
        client.wait(lambda: int(client.diagnostics()["commands refused"]) >= count)

    client.publish("release", String(data="cup"))
    told(1)
    client.publish("attach", String(data="cap"))
    told(2)
    client.publish("attach", String(data="cup"))
    client.advance()
    client.publish("attach", String(data="cup"))
    told(3)
    client.publish("release", String(data="cup"))
    client.advance()
    values = client.diagnostics()
    assert (values["refused: unknown name"], values["refused: out of order"]) == ("1", "2")
    process.stop()
    commanded = [record.actuators for record in BagRun(tmp_path / "bag").records if record.actuators]
    assert commanded == [{"cup": 1.0}, {"cup": 0.0}]
    report = Replay(BagRun(tmp_path / "bag")).run()
    assert report.differences.verdict() is Difference.IDENTICAL


def test_a_refusal_by_a_step_names_the_full_topics(client: Any, launch: Callable, tmp_path: Path) -> None:
    """A step refuses a grip that is far away, a body in an obstacle, and a velocity, with names as at the arrival."""
    (tmp_path / "cup.yaml").write_text(SCENE)
    process = launch(scene=str(tmp_path / "cup.yaml"), clock="lockstep", dt=0.5, velocity_timeout=10.0)
    told: list[Any] = []
    client.node.create_subscription(String, client.full("refused"), lambda text: told.append(json.loads(text.data)), 10)
    client.wait(lambda: client.node.count_publishers(client.full("refused")))
    client.diagnostics()
    client.publish("bodies/box/set", PoseStamped(pose=Pose(position=Point(z=0.01))))
    client.publish("bodies/box/set", PoseStamped(pose=Pose(position=Point(z=-0.1))))
    client.publish("attach", String(data="cup"))
    client.publish("handles/base/velocity", TwistStamped(twist=Twist(linear=Vector3(x=0.39))))
    client.publish("bodies/box/set", PoseStamped(pose=Pose(position=Point(z=math.nan))))
    client.advance(9)  # some of these steps may take the commands above
    client.wait(lambda: len(told) >= 4)
    box = "/gdfe_sim/bodies/box/set"
    late = {each["source"] for each in told if each["late"]}
    assert late == {"/gdfe_sim/attach", box, "/gdfe_sim/handles/base/velocity"}
    assert [each["source"] for each in told if not each["late"]] == [box]
    assert f"command on {box} refused: " in process.log
    assert "command on /gdfe_sim/attach refused: " in process.log


def test_a_simulator_raises_what_a_step_refuses(tmp_path: Path) -> None:
    """A grip from too far away is an error, as of Simulation.step, and the next step is made without it."""
    (tmp_path / "cup.yaml").write_text(SCENE.replace("0.0151", "0.1"))
    with Simulator(tmp_path / "cup.yaml") as simulator:
        with pytest.raises(CommandError, match=r"command on /\S+/actuation refused: .*cup"):
            simulator.step(Command(actuators={"cup": 1.0}))
        assert simulator.step().record.actuators == {"cup": 0.0}


def test_a_flood_of_grips_is_survived(client: Any, launch: Callable, tmp_path: Path) -> None:
    """Thousands of names that are no grips, and a grip that is taken and let go at random, end nothing."""
    (tmp_path / "cup.yaml").write_text(SCENE)
    process = launch(scene=str(tmp_path / "cup.yaml"), clock="fast", dt=0.002, heartbeat=0.0)
    names = [
        "cup",
        "cap",
        "",
        "box",
        "\x1b[2J",
        "cup\n[ERROR] forged",
        "\u202epuc",
        "x" * 100_000,
        "a/../cup",
        "__class__",
    ]
    rng = random.Random(5)
    for number in range(3000):
        client.publish(rng.choice(("attach", "release")), String(data=rng.choice(names)))
        if number % 100 == 0:
            assert client.state() == "active"
    client.wait(lambda: int(client.diagnostics()["refused: unknown name"]) > 1000)
    assert all(line.isprintable() for line in process.log.splitlines())
    assert not any(line.startswith("[ERROR] forged") for line in process.log.splitlines())
    assert process.stop() == 0
