# SPDX-License-Identifier: Apache-2.0
"""Cables that run on to points in the world or to another body, and attach points beside the skin."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from test.written import advance, scene_of

ARM = """
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}}}
probes: {tip: [0.1, 0, 0]}
actuators: {rope: {cable: {points: [{world: [0.13, 0.0, 0.2]}, [0.1, 0.0, 0.0]], command: COMMAND}}}
solver: {tolerance: 1.0e-7}
"""
ANCHOR = np.array([0.13, 0.0, 0.2])


def _simulation(command: str = "tension", change: tuple[str, str] = ("", ""), more: str = "") -> Simulation:
    return Simulation(scene_of((ARM + more).replace("COMMAND", command).replace(*change)))


@pytest.mark.parametrize("far", [0.0, 500.0])
def test_the_base_holds_what_the_cable_pulls(far: float) -> None:
    """The base bears the tension along the line to the anchor, with its torque, also far from the world's origin."""
    places = f"meshes: {{arm: {{at: [{far}, 0, 0], bar: {{size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}}}}}"
    text = ARM.replace("COMMAND", "tension").replace(
        "mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}", places
    )
    text = text.replace("{world: [0.13", f"{{world: [{far + 0.13}").replace("tip: [0.1", f"tip: [{far + 0.1}")
    text = text.replace(" [0.1, 0.0, 0.0]]", f" [{far + 0.1}, 0.0, 0.0]]").replace(
        "{face: x-}", "{mesh: arm, face: x-}"
    )
    simulation = Simulation(scene_of(text))
    result = advance(simulation, Command(actuators={"rope": 2.0}))
    tip = simulation.probe_positions()["tip"]
    along = ANCHOR + np.array([far, 0.0, 0.0]) - tip
    force = 2.0 * along / np.linalg.norm(along)
    assert tip[2] > 0.01
    np.testing.assert_allclose(-result.reactions["base"][:3], force, atol=1e-4)
    torque = np.cross(tip - [far, 0.0, 0.0], force)
    np.testing.assert_allclose(-result.reactions["base"][3:], torque, atol=1e-4)
    assert result.actuators["rope"].extent == pytest.approx(np.linalg.norm(along), rel=1e-7)


@pytest.mark.parametrize("more", ["", "dynamics: {step: 0.01, damping: {viscosity: 2000}}\n"])
def test_a_commanded_length_reaches_to_the_anchor(more: str) -> None:
    """A cable shortened by 1 cm ends 1 cm nearer to its anchor, also when the base moves, in statics and in motion."""
    simulation = _simulation("shortening", more=more)
    for height in (0.0, 0.005):
        for _ in range(30 if more else 1):
            result = simulation.step(Command({"base": Pose((0, 0, height))}, actuators={"rope": 0.01}), dt=0.01)
        length = np.linalg.norm(ANCHOR - simulation.probe_positions()["tip"])
        assert result.converged
        assert length == pytest.approx(np.linalg.norm(ANCHOR - [0.1, 0, 0]) - 0.01, abs=1e-6)
    assert result.actuators["rope"].effort > 0.0


def test_derivatives_agree_with_differences() -> None:
    """The derivatives of the tip by the tension and by the base's motion agree with central differences."""
    simulation = _simulation()

    def tip(tension: float, height: float) -> np.ndarray:
        simulation.step(Command({"base": Pose((0, 0, height))}, actuators={"rope": tension}))
        return simulation.probe_positions()["tip"].copy()

    by_tension = (tip(1.01, 0.0) - tip(0.99, 0.0)) / 0.02
    by_height = (tip(1.0, 1e-4) - tip(1.0, -1e-4)) / 2e-4
    tip(1.0, 0.0)
    found = simulation.sensitivities(["probes.tip"], ["actuators.rope", "handles.base.z"])
    np.testing.assert_allclose(found.of("probes.tip", "actuators.rope"), by_tension, rtol=2e-3, atol=1e-5)
    np.testing.assert_allclose(found.of("probes.tip", "handles.base.z"), by_height, rtol=2e-3, atol=1e-4)


def test_a_cable_joins_two_bodies() -> None:
    """A cable between two bodies pulls each of them with its tension."""
    bar = "{bar: {size: [0.05, 0.02, 0.02], cells: [5, 2, 2]}, at: "
    text = (
        ARM.replace(
            "mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [10, 2, 2]}}",
            f"""meshes:
  left: {bar}[0, 0, 0]}}
  right: {bar}[0, 0, 0.1]}}""",
        )
        .replace(
            "{base: {where: {face: x-}}}",
            """
  low: {where: {mesh: left, face: x-}, fixed: true}
  high: {where: {mesh: right, face: x-}, fixed: true}""",
        )
        .replace("probes: {tip: [0.1, 0, 0]}", "")
    )
    points = "[{mesh: left, at: [0.05, 0, 0]}, {mesh: right, at: [0.05, 0, 0]}]"
    text = text.replace("[{world: [0.13, 0.0, 0.2]}, [0.1, 0.0, 0.0]]", points).replace("COMMAND", "tension")
    result = advance(Simulation(scene_of(text)), Command(actuators={"rope": 1.0}))
    np.testing.assert_allclose(result.reactions["low"][:3], [0, 0, -1.0], atol=1e-4)
    np.testing.assert_allclose(result.reactions["high"][:3], [0, 0, 1.0], atol=1e-4)


def test_a_point_beside_the_skin_is_moved_onto_it() -> None:
    """A point less than half a cell outside is moved, with a remark; one farther away is refused."""
    simulation = _simulation(change=("[0.1, 0.0, 0.0]]", "[0.09, 0.0, 0.0149]]"))
    assert any("moved onto it, by up to 0.0049 m" in text for text in simulation.remarks())
    np.testing.assert_allclose(simulation.scene.actuators[0].points.at(simulation.positions)[1], [0.09, 0, 0.01])
    with pytest.raises(SceneError, match=r"point 0 at \(0.09, 0, 0.0151\) m lies outside"):
        _simulation(change=("[0.1, 0.0, 0.0]]", "[0.09, 0.0, 0.0151]]"))


def test_a_cable_needs_a_body() -> None:
    """A cable between two points in the world is refused."""
    with pytest.raises(SceneError, match="at least one point of a body"):
        _simulation(change=("[0.1, 0.0, 0.0]]", "{world: [0.1, 0, 0]}]"))
