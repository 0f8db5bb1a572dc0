# SPDX-License-Identifier: Apache-2.0
"""Grips: handles, obstacles and rigid bodies take hold of faces and rigid bodies, and let go."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import CommandError, GdfeError, SceneError
from gdfe_ros.node.driving.remodelling import take_over, with_moduli
from gdfe_ros.testing import make_env
from test.written import advance, scene_of

BAR = """
mesh: {bar: {size: [0.04, 0.02, 0.02], cells: [4, 2, 2]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.4, density: 1000}}
solver: {tolerance: 1.0e-8}
handles: {base: {where: {face: x-}}}
"""
HAND = (
    BAR
    + """
obstacles: {hand: {box: {size: [0.01, 0.03, 0.03]}, at: [0.0451, 0, 0]}}
actuators: {cup: {grip: {to: hand, where: {face: x+}}}}
"""
)
CARRY = (
    BAR
    + """
bodies: {box: {box: {size: [0.02, 0.02, 0.02]}, mass: 0.1, at: [0.2, 0, 0]}}
obstacles: {hand: {box: {size: [0.02, 0.02, 0.01]}, at: [0.2, 0, 0.0151], friction: 0.5}}
actuators: {cup: {grip: {to: hand, body: box}}}
loads: {w: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.002, scheme: bdf2}
"""
)
ON, OFF = Command(actuators={"cup": 1.0}), Command(actuators={"cup": 0.0})


def _still(simulation: Simulation, count: int, command: Command | None = None) -> object:
    return advance(simulation, command, dt=0.002, count=count)


def _carried() -> tuple[Simulation, list[np.ndarray]]:
    """Return a simulation in which a hand has taken a body, lifted and turned it, and let go; and its positions."""
    simulation, found = Simulation(scene_of(CARRY)), []
    for k in range(40):
        lift = Pose((0, 0, 5e-4 * min(k, 20)), (0.02 * min(k, 20), 0, 0))
        _still(simulation, 1, Command(actuators={"cup": 1.0}, handles={"hand": lift}))
        found.append(simulation.state.positions)
    return simulation, found


def test_a_hand_carries_the_weight_of_a_body_and_lets_it_fall() -> None:
    """A held body moves and turns with the hand, which bears its weight; released, it falls freely without a jump."""
    simulation, _ = _carried()
    result = _still(simulation, 20)
    np.testing.assert_allclose(result.reactions["hand"][:3], [0, 0, 0.981], atol=1e-6)
    assert simulation.actuator_states()["cup"].effort == pytest.approx(0.981, abs=1e-6)
    # The hand turns about its own centre, 15.1 mm above that of the body.
    angle, arm = 0.4, np.array([0, 0, -0.0151])
    turned = np.array([0, np.sin(angle) * 0.0151, -np.cos(angle) * 0.0151])
    pose = simulation.handle_pose("box")
    np.testing.assert_allclose(pose.translation, turned - arm + [0, 0, 0.01], atol=1e-9)
    np.testing.assert_allclose(pose.rotation, [angle, 0, 0], atol=1e-9)
    moment = result.reactions["hand"][3]
    assert moment == pytest.approx(turned[1] * 0.981, abs=1e-8)
    _still(simulation, 1, OFF)
    heights = [pose.translation[2]]
    for _ in range(40):
        _still(simulation, 1)
        heights.append(simulation.handle_pose("box").translation[2])
    assert 0.0 < heights[0] - heights[1] < 9.81 * 0.004**2
    np.testing.assert_allclose(np.diff(heights[-12:], 2) / 0.002**2, -9.81, rtol=1e-6)
    assert simulation.actuator_states()["cup"].effort == 0.0
    np.testing.assert_array_equal(simulation.result.reactions["hand"], 0.0)


def test_a_run_with_a_grip_is_repeated_to_the_bit() -> None:
    """A second run has the same positions, and so have steps from a state that was saved while something was held."""
    (first, once), (_, twice) = _carried(), _carried()
    np.testing.assert_array_equal(once, twice)
    other = Simulation(first.scene)
    load_state(other, save_state(first))
    for simulation in (first, other):
        _still(simulation, 2)
        _still(simulation, 5, OFF)
    np.testing.assert_array_equal(first.state.positions, other.state.positions)


def test_a_held_face_has_the_shape_and_force_of_a_handle() -> None:
    """A face that an obstacle holds, moves and turns is in the same equilibrium as one that a handle moves."""
    with_handle = BAR.replace("handles: {", "handles: {tip: {where: {face: x+}}, ")
    held, driven = (Simulation(scene_of(text)) for text in (HAND, with_handle))
    held.step(ON)
    for k in range(1, 5):
        turn, shift = (0.0, 0.0, 0.1 * k), np.array([0.002 * k, 0.001 * k, 0.0])
        arm = np.array([-0.0051, 0.0, 0.0])
        turned = np.array([-0.0051 * np.cos(0.1 * k), -0.0051 * np.sin(0.1 * k), 0.0]) - arm
        one = advance(held, Command(handles={"hand": Pose(tuple(shift), turn)}))
        two = advance(driven, Command(handles={"tip": Pose(tuple(shift + turned), turn)}))
        assert one.stable
        np.testing.assert_allclose(one.positions, two.positions, atol=1e-9)
        np.testing.assert_allclose(one.reactions["hand"][:3], two.reactions["tip"][:3], atol=1e-6)
        np.testing.assert_allclose(one.reactions["hand"][:3], -one.reactions["base"][:3], atol=1e-6)
    free = advance(held, OFF)
    np.testing.assert_allclose(free.positions, held.mesh.vertices, atol=1e-9)


def test_derivatives_while_a_face_is_held() -> None:
    """Derivatives of positions and reactions by the hand's pose agree with differences; those by the grip are zero."""
    simulation = Simulation(scene_of(HAND + "probes: {middle: [0.02, 0.01, 0.0]}\n"))
    simulation.step(ON)

    def values(shift: float) -> tuple[np.ndarray, np.ndarray]:
        result = simulation.step(Command(handles={"hand": Pose((0.004, 0.002 + shift, 0), (0, 0, 0.2))}))
        return simulation.probe_positions()["middle"].copy(), result.reactions["hand"][:3]

    (above, up), (below, down) = values(1e-5), values(-1e-5)
    values(0.0)
    outputs = ["probes.middle", "reactions.hand"]
    found = simulation.sensitivities(outputs, ["obstacles.hand.y", "actuators.cup"])
    np.testing.assert_allclose(found.of("probes.middle", "obstacles.hand.y"), (above - below) / 2e-5, atol=1e-5)
    np.testing.assert_allclose(found.of("reactions.hand", "obstacles.hand.y")[:3], (up - down) / 2e-5, atol=0.05)
    np.testing.assert_array_equal(found.of("probes.middle", "actuators.cup"), 0.0)
    np.testing.assert_array_equal(simulation.jacobian(), np.zeros((1, 3, 1)))


SOFT = (
    BAR.replace("[0.04, 0.02, 0.02]", "[0.02, 0.02, 0.06]").replace("[4, 2, 2]", "[2, 2, 6]").replace("x-", "z+")
    + """
bodies: {box: {box: {size: [0.02, 0.02, 0.02]}, mass: 0.02, at: [0.01, 0, -0.0402]}}
actuators: {cup: {grip: {to: box, where: {face: z-}}}}
loads: {w: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.005, scheme: bdf2, damping: {viscosity: 300.0}}
"""
)


def test_a_soft_arm_lifts_a_body_with_its_face() -> None:
    """A body that hangs at the face of a soft arm: the base bears both weights, and the pull is the body's weight."""
    simulation = Simulation(scene_of(SOFT))
    result = simulation.step(ON, dt=0.005)
    result = advance(simulation, dt=0.005, count=150)
    assert simulation.actuator_states()["cup"].effort == pytest.approx(0.02 * 9.81, rel=1e-4)
    total = (0.02 + 1000 * 0.02 * 0.02 * 0.06) * 9.81
    np.testing.assert_allclose(result.reactions["base"][:3], [0, 0, total], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("scheme", ["bdf2", "generalised_alpha"])
def test_momentum_is_kept_at_release(scheme: str) -> None:
    """A body that a hand moves at a constant velocity flies on with this velocity after the release."""
    text = CARRY.replace("scheme: bdf2", f"scheme: {scheme}").replace("loads: {w: {gravity: [0, 0, -9.81]}}", "")
    simulation, places = Simulation(scene_of(text)), []
    for k in range(1, 91):
        time, rising = 0.002 * k, min(0.002 * k, 0.1)
        shift = 0.3 * (0.5 * rising - 0.05 / np.pi * np.sin(np.pi * rising / 0.1) + time - rising)
        command = Command(actuators={"cup": float(k < 80)}, handles={"hand": Pose((0, shift, 0))})
        _still(simulation, 1, command)
        places.append(simulation.handle_pose("box").translation)
    velocities = np.diff(places[-13:], axis=0) / 0.002
    np.testing.assert_allclose(velocities, np.tile([0, 0.3, 0], (12, 1)), atol=3e-4)


def test_what_cannot_be_gripped_is_refused() -> None:
    """Something out of reach, a held body that is put elsewhere, and wrong entries of a scene are refused by name."""
    far = Simulation(scene_of(CARRY.replace("0.0151", "0.0251")))
    with pytest.raises(CommandError, match=r"body 'box' is 0\.0101 m from 'hand'; allowed: up to its `reach`, 0\.005"):
        far.step(ON)
    with pytest.raises(CommandError, match="no actuator 'cap'"):
        far.step(Command(actuators={"cap": 1.0}))
    assert far.step(OFF, dt=0.002).converged
    simulation = Simulation(scene_of(CARRY))
    _still(simulation, 2, ON)
    with pytest.raises(CommandError, match="body 'box' is held by grip 'cup'"):
        simulation.step(Command(bodies={"box": Pose((0, 0.1, 0))}))
    wrong = {
        "to: hand": ("to: hnd", "there is no such handle, obstacle or body"),
        "body: box": ("body: bax", "there is no such body"),
        "{to: hand, body: box}": ("{to: box, body: box}", "cannot hold itself"),
        ", body: box": (", body: box, where: {face: x+}", "exactly one of body"),
    }
    for key, (text, said) in wrong.items():
        with pytest.raises(SceneError, match=said):
            scene_of(CARRY.replace(key, text))
    with pytest.raises(SceneError, match="newmark does not damp"):
        scene_of(CARRY.replace("bdf2", "newmark"))
    with pytest.raises(SceneError, match="handles hold some of these vertices already: base"):
        scene_of(HAND.replace("where: {face: x+}", "where: {face: y+}"))


@pytest.mark.parametrize("place", ["0.0149999", "-0.0150001"])
def test_contact_adds_nothing_to_the_force_of_a_grip(place: str) -> None:
    """A held body that touches the hand from below, or rests on it, is held by its weight, step after step."""
    simulation = Simulation(scene_of(CARRY.replace("0.0151", place)))
    for k in range(40):
        result = _still(
            simulation, 1, Command(actuators={"cup": 1.0}, handles={"hand": Pose((0, 1e-4 * min(k, 20), 0))})
        )
    np.testing.assert_allclose(result.reactions["hand"][:3], [0, 0, 0.981], atol=1e-6)
    _still(simulation, 5, OFF)


def test_a_face_that_is_pressed_and_gripped_is_pulled_and_let_go() -> None:
    """A hand that presses a face, grips, pulls and tilts it has the base's reaction, and leaves the face at rest."""
    simulation = Simulation(scene_of(HAND.replace("0.0451, 0, 0]", "0.0451, 0, 0], friction: 0.5")))
    pressed = simulation.step(Command(handles={"hand": Pose((-0.0015, 0, 0))})).reactions["hand"]
    assert pressed[0] < -1.0
    np.testing.assert_allclose(simulation.step(ON).reactions["hand"], pressed, atol=1e-7)
    for k in range(1, 5):
        result = advance(simulation, Command(handles={"hand": Pose((-0.0015 + 0.001 * k, 0, 0), (0, 0, 0.05 * k))}))
        np.testing.assert_allclose(result.reactions["hand"][:3], -result.reactions["base"][:3], atol=1e-6)
        force = simulation.actuator_states()["cup"].effort
        assert force == pytest.approx(np.linalg.norm(result.reactions["hand"][:3]), abs=1e-6)
    free = advance(simulation, OFF)
    np.testing.assert_allclose(free.positions, simulation.mesh.vertices, atol=1e-8)


TWO_CUPS = CARRY.replace("obstacles: {", "obstacles: {hook: {box: {size: [0.02, 0.02, 0.01]}, at: [0.2, 0, -0.0151]}, ")
TWO_CUPS = TWO_CUPS.replace("body: box}}}", "body: box}}, cap: {grip: {to: hook, body: box}}}")


def test_two_grips_share_a_body_and_cannot_pull_it_apart() -> None:
    """Two grips bear one weight together; a step in which they pull the body apart fails soon, and says why."""
    simulation = Simulation(scene_of(TWO_CUPS))
    result = _still(simulation, 20, Command(actuators={"cup": 1.0, "cap": 1.0}))
    assert result.reactions["hand"][2] + result.reactions["hook"][2] == pytest.approx(0.981, abs=1e-6)
    apart = simulation.step(Command(handles={"hand": Pose((0, 0, 1e-3))}), dt=0.002)
    assert not apart.converged
    assert "grips" in apart.message
    assert apart.iterations < 5000


def test_a_body_holds_another_body() -> None:
    """A ball that a falling box holds keeps its place on it, also when they hit something and spin."""
    text = (
        BAR
        + """
bodies:
  box: {box: {size: [0.02, 0.02, 0.02]}, mass: 0.1, at: [0.2, 0, 0]}
  ball: {sphere: {radius: 0.01}, mass: 0.05, at: [0.2, 0, 0.0202]}
obstacles: {pad: {sphere: {radius: 0.01}, at: [0.206, 0, -0.03]}}
actuators: {cup: {grip: {to: box, body: ball}}}
loads: {w: {gravity: [0, 0, -9.81]}}
dynamics: {step: 0.002, scheme: bdf2}
"""
    )
    simulation = Simulation(scene_of(text))
    _still(simulation, 60, ON)
    box, ball = simulation.handle_pose("box"), simulation.handle_pose("ball")
    arm = np.array([0.0, 0.0, 0.0202])
    np.testing.assert_allclose(ball.rotation, box.rotation, atol=1e-9)
    moved = Pose(box.translation, box.rotation).apply(arm[None], np.zeros(3))[0]
    np.testing.assert_allclose(arm + ball.translation, moved, atol=1e-9)
    assert abs(box.rotation[1]) > 0.1


def test_resets_let_go() -> None:
    """After a reset, and after a reset of the shape, nothing is held; the grip can take hold anew."""
    simulation = Simulation(scene_of(CARRY))
    for reset in (simulation.reset, simulation.reset_shape):
        _still(simulation, 3, ON)
        assert simulation.actuator_states()["cup"].extent == 1.0
        reset()
        assert simulation.step(dt=0.002).converged
        assert simulation.actuator_states()["cup"].extent == 0.0


def test_a_spawn_keeps_what_is_held() -> None:
    """A motion goes on with a held body in a scene that has one body more, as without it."""
    simulation = Simulation(scene_of(CARRY))
    _still(simulation, 5, ON)
    more = CARRY.replace("bodies: {", "bodies: {ball: {sphere: {radius: 0.01}, mass: 0.02, at: [0.3, 0, 0]}, ")
    other = Simulation(scene_of(more))
    take_over(simulation, other)
    for each in (simulation, other):
        _still(each, 5, Command(handles={"hand": Pose((0, 0, 0.001))}))
    expected = simulation.handle_pose("box").translation
    np.testing.assert_allclose(other.handle_pose("box").translation, expected, atol=1e-9)


def test_other_moduli_need_free_grips_in_statics() -> None:
    """Without dynamics, another modulus is refused while something is held: its places at rest are not known."""
    simulation = Simulation(scene_of(HAND))
    simulation.step(ON)
    with pytest.raises(GdfeError, match="grips hold something"):
        with_moduli(simulation, {"m": 2e5})
    simulation.step(OFF)
    assert with_moduli(simulation, {"m": 2e5}).result.converged


def test_an_environment_grips_what_is_within_reach() -> None:
    """Actions of an environment take hold and let go; an action to grip something out of reach changes nothing."""
    for place, holds in (("0.0151", 1.0), ("0.0251", 0.0)):
        env = make_env(
            scene_of(CARRY.replace("0.0151", place) + "probes: {tip: [0.04, 0, 0]}\n"),
            reward=lambda simulation, action: 0.0,
            dt=0.01,
        )
        env.reset(seed=0)
        *_, truncated, info = env.step([1.0])
        assert not truncated
        assert info["applied"] == [holds]
        fallen = env.simulation.handle_pose("box").translation[2]
        assert (abs(fallen) < 1e-9) == bool(holds)
        seen = env.step([1.0])[0]
        assert seen[4] == env.simulation.actuator_states()["cup"].effort
        assert (seen[4] > 0.9) == bool(holds)
        env.step([0.0])
        assert env.simulation.actuator_states()["cup"].extent == 0.0


def test_a_program_grips_and_releases() -> None:
    """Values of a program between 0 and 1 count as the nearer of the two."""
    text = CARRY + "program: {duration: 0.04, actuators: {cup: [{time: 0.01, value: 1}, {time: 0.031, value: 0}]}}\n"
    simulation = Simulation(scene_of(text))
    program, held = simulation.scene.program, []
    for moment in np.arange(1, 21) * 0.002:
        simulation.step(Command(actuators=program.actuator_values(moment)), dt=0.002)
        held.append(simulation.actuator_states()["cup"].extent)
    np.testing.assert_array_equal(held, [0.0] * 2 + [1.0] * 8 + [0.0] * 10)


def test_two_grips_that_let_go_together_are_no_jump() -> None:
    """A bar that two grips bend returns to rest when both let go in one step, which converges without a message.

    The last part of the released forces' work was missing, and the step was told as a jump, as in buckling.
    """
    text = HAND.replace("obstacles: {", "obstacles: {hook: {box: {size: [0.01, 0.03, 0.03]}, at: [0.02, 0, 0.03]}, ")
    second = {"grip": {"to": "hook", "where": {"box": {"x": [0.02, 0.02], "z": [0.01, 0.01]}}, "reach": 0.02}}
    simulation = Simulation(scene_of(text, actuators__second=second))
    advance(simulation, Command(actuators={"cup": 1.0, "second": 1.0}))
    poses = {"hand": Pose((0.006, 0.01, 0), (0, 0, 0.4)), "hook": Pose((0, 0, 0.004))}
    advance(simulation, Command(handles=poses))
    result = advance(simulation, Command(actuators={"cup": 0.0, "second": 0.0}))
    assert not result.message
    np.testing.assert_allclose(result.positions, simulation.mesh.vertices, atol=1e-7)
