# SPDX-License-Identifier: Apache-2.0
"""Grips over topics: attach and release by name, refusals, and bags that replay to the bit."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay

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
