# SPDX-License-Identifier: Apache-2.0
"""The live page from a viewer's side: displays and commands."""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from websockets.exceptions import ConnectionClosed

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.cli import main
from gdfe_ros.live.interface import Ability
from gdfe_ros.live.page import Page
from gdfe_ros.live.session import LiveSession
from gdfe_ros.live.stage import first_view, round_length, scale_of
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.node.driving.orders import ActuatorOrder
from gdfe_ros.node.interface.topics import state_topics
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.simulation import Command, Simulation
from test.live.viewer import Viewer


@pytest.mark.parametrize("name", ["ball_gripper", "gripper", "grasp", "pneunet"])
def test_the_first_view_shows_the_whole_program(name: str) -> None:
    """At first the camera sees the undeformed body, the rigid bodies, and the body at each pose of the program."""
    scene = load_scene(name)
    target, eye = first_view(scene)
    moves = [key.pose.translation for keys in scene.program.keyframes.values() for key in keys]
    places = [body.origin for body in scene.rigid_bodies]
    seen = np.vstack([scene.mesh.vertices, *(scene.mesh.vertices + move for move in moves), *places])
    rays, axis = scale_of(scene.mesh) * seen - eye, (target - eye) / np.linalg.norm(target - eye)
    assert (rays @ axis / np.linalg.norm(rays, axis=1)).min() > np.cos(np.radians(30.0))


def test_a_dragged_handle_leads_the_body(live: Callable[..., Any]) -> None:
    """Dragging and turning the tip's control moves the handle, in metres and radians."""
    page = live()
    viewer = page.look()
    half = np.deg2rad(15.0)
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.3]), (np.cos(half), np.sin(half), 0.0, 0.0))
    simulation = page.session.simulation
    viewer.wait(lambda: simulation.targets["tip"].translation[2] > 0.0, "the drag")
    scale = 10.0 ** round(-np.log10(simulation.mesh.size))
    np.testing.assert_allclose(simulation.targets["tip"].translation, [0.0, 0.0, 0.3 / scale], atol=1e-9)
    np.testing.assert_allclose(simulation.targets["tip"].rotation, [2.0 * half, 0.0, 0.0], atol=1e-9)
    viewer.wait(lambda: "/reactions/arrows" in viewer.nodes and viewer.nodes["/reactions/arrows"]["visible"], "arrows")


def test_a_drag_out_of_reach_is_refused(live: Callable[..., Any]) -> None:
    """Dragging a handle a hundred body lengths away is refused with a note of the allowed range."""
    page = live()
    viewer = page.look()
    viewer.drag("tip", [300.0, 0.0, 0.0])
    viewer.wait(lambda: viewer.notes, "a note")
    assert "times the body's size" in viewer.notes[0]
    assert page.session.simulation.targets["tip"].translation == (0.0, 0.0, 0.0)


def test_buttons_play_pause_step_and_reset(live: Callable[..., Any]) -> None:
    """The buttons play the program, pause it, make one step and reset, as the simulated times show."""
    page = live()
    viewer, session = page.look(), page.session
    viewer.press("play the program")
    viewer.wait(lambda: session.last.record.time > 0.05, "the program")
    viewer.press("pause")
    viewer.wait(
        lambda: session.stepper.paused and session.stepper.work is None and "go on" in viewer.controls, "a hold"
    )
    count, time = session.stepper.count, session.last.record.time
    viewer.press("one step")
    viewer.wait(lambda: session.stepper.count == count + 1, "one step")
    assert session.last.record.time == pytest.approx(time + 0.01)
    assert session.last.record.handles
    viewer.press("reset")
    viewer.wait(lambda: session.last.record.time == 0.0, "the reset")
    assert session.playing is None


def test_the_program_is_played_to_its_end_before_a_viewer(live: Callable[..., Any]) -> None:
    """A program is played to its end; then its last commands are set, and slider and control show them."""
    page = live()
    viewer, session = page.look(), page.session
    viewer.press("play the program")
    viewer.wait(lambda: session.playing is None and session.last.record.time >= 1.0, "the program's end")
    assert session.simulation.commands == {"lower": 1.0, "left": 1.0, "weight": 1.0}
    assert session.simulation.targets["tip"].translation == pytest.approx((0.0, 0.0, 0.02))
    uuid = viewer.controls["lower, tension [N]"]["uuid"]
    viewer.wait(lambda: viewer.values[uuid] == 1.0, "the slider at the program's end")
    assert viewer.place("tip")[2] == pytest.approx(0.2)


def test_a_slider_widens_to_what_others_command(live: Callable[..., Any]) -> None:
    """A command by another source above a slider's maximum widens the slider and is shown."""
    page = live()
    viewer, session = page.look(), page.session
    uuid = viewer.controls["weight, factor [1]"]["uuid"]
    session.command("weight", ActuatorOrder({"weight": 3.0}))
    viewer.wait(lambda: viewer.values[uuid] == 3.0, "the slider")
    assert viewer.controls["weight, factor [1]"]["props"]["max"] == 3.0
    viewer.move("weight, factor [1]", 2.5)
    viewer.wait(lambda: session.simulation.commands["weight"] == 2.5, "the slider's move")


def test_what_a_viewer_commands_leaves_the_program(live: Callable[..., Any]) -> None:
    """A slider moved during the program keeps its actuator, and the program continues with the other one."""
    page = live()
    viewer, session = page.look(), page.session
    viewer.press("play the program")
    viewer.wait(lambda: session.last.record.time > 0.1, "the program")
    viewer.move("lower, tension [N]", 1.25)
    viewer.wait(lambda: session.last.record.time > 0.8, "the other's turn")
    assert session.simulation.commands["lower"] == 1.25
    assert session.simulation.commands["left"] > 0.0


def test_a_bag_begun_in_the_middle_replays(live: Callable[..., Any], tmp_path: Path, monkeypatch: Any) -> None:
    """A bag recorded by the button from the middle of a program replays to the last bit."""
    monkeypatch.chdir(tmp_path)
    page = live()
    viewer, session = page.look(), page.session
    viewer.press("play the program")
    viewer.wait(lambda: session.last.record.time > 0.1, "the program")
    viewer.press("record")
    viewer.wait(lambda: "finish the bag" in viewer.controls, "the bag")
    begun = session.last.record.time
    viewer.wait(lambda: session.last.record.time > begun + 0.1, "some steps")
    viewer.press("finish the bag")
    viewer.wait(lambda: any("messages" in note for note in viewer.notes), "the bag's end")
    report = Replay(BagRun(next((tmp_path / "runs").iterdir()))).run()
    assert report.verdict() is Difference.IDENTICAL
    assert report.differences.steps > 5


TOUCHING = "obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.0101]}}\nsensors: {pad: {where: {face: z-}}}"


@pytest.mark.parametrize("motion", ["", "dynamics: {step: 0.01}", TOUCHING])
def test_a_bag_holds_what_the_node_would_record(live: Callable[..., Any], tmp_path: Path, motion: str) -> None:
    """A bag of a scene at rest, in motion or in contact has every topic of the node, readable by rclpy."""
    from rclpy.serialization import deserialize_message

    from gdfe_ros.node.middleware.ros_types import interface_class

    session = live(motion=motion).session
    session.record(tmp_path / "bag").result()
    session.ask(Ability.STEP)
    session.record(None).result()
    reader = BagReader(tmp_path / "bag")
    names = set()
    for message in reader.messages(list(reader.topics)):
        deserialize_message(message.data, interface_class(message.type))
        names.add(message.topic)
    assert names == set(reader.topics)
    assert {name.removeprefix("/gdfe_sim/") for name in names} >= set(state_topics(session.scene))
    assert Replay(BagRun(tmp_path / "bag")).run().verdict() is Difference.IDENTICAL


def test_a_dragged_rigid_body_is_put_and_falls_on(live: Callable[..., Any], tmp_path: Path) -> None:
    """A falling cube dragged up is put there and falls again, its control follows, and the bag replays."""
    cube = "{box: {size: [0.01, 0.01, 0.01]}, density: 500, at: [0.2, 0, 0.2]}"
    page = live(motion=f"dynamics: {{step: 0.01}}\nbodies: {{cube: {cube}}}\n{TOUCHING}")
    viewer, session = page.look(), page.session
    session.record(tmp_path / "bag").result()
    viewer.wait(lambda: viewer.place("cube")[2] < 1.9, "the control's way with the cube")
    viewer.drag("cube", [2.0, 1.0, 3.0])
    viewer.wait(lambda: session.last.record.bodies or session.last.poses["cube"].translation[2] > 0.05, "the put")
    viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][2] > 2.0, "the cube up there")
    viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][2] < 2.5, "its fall from there")
    assert session.last.poses["cube"].translation[1] == pytest.approx(0.1, abs=1e-6)
    viewer.wait(lambda: viewer.place("cube")[2] < 2.0, "the control's way with it")
    session.record(None).result()
    assert Replay(BagRun(tmp_path / "bag")).run().verdict() is Difference.IDENTICAL


@pytest.mark.parametrize("place", [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])
def test_what_is_no_number_is_refused(live: Callable[..., Any], place: list[float]) -> None:
    """A drag or slider value that is no number gives a note and changes nothing."""
    page = live()
    viewer, session = page.look(), page.session
    viewer.drag("tip", place)
    viewer.wait(lambda: viewer.notes, "a note")
    assert "a control is dragged to" in viewer.notes[0]
    viewer.move("lower, tension [N]", place[0])
    viewer.wait(lambda: len(viewer.notes) > 1, "another note")
    assert "lower, tension [N]: " in viewer.notes[1]
    viewer.wait(lambda: np.isfinite(viewer.place("tip")).all(), "the control back at its target")
    viewer.move("lower, tension [N]", 1.5)
    viewer.wait(lambda: session.simulation.commands["lower"] == 1.5, "the run going on")
    assert (session.stepper.failure, page.page.faults) == ("", 0)


def test_obstacles_and_bodies_are_where_they_are(live: Callable[..., Any]) -> None:
    """A dragged ball's shape follows it, and a falling cube is drawn at the simulated pose."""
    things = "obstacles: {ball: {sphere: {radius: 0.01}, at: [0.05, 0, 0.05]}}\nbodies: {cube: {box: {size: [0.01, "
    things += "0.01, 0.01]}, density: 500, at: [0.2, 0, 0.2], rotation_deg: [0, 0, 30]}}\ndynamics: {step: 0.01}"
    page = live(motion=things)
    viewer, session = page.look(), page.session
    shape = viewer.nodes["/obstacles/ball"]["vertices"].reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(shape, axis=1), 0.1, rtol=1e-6)
    np.testing.assert_allclose(viewer.nodes["/obstacles/ball"]["position"], [0.5, 0.0, 0.5], atol=1e-6)
    viewer.drag("ball", [0.6, 0.1, 0.5])
    viewer.wait(lambda: viewer.nodes["/obstacles/ball"]["position"][0] > 0.55, "the ball's way")
    np.testing.assert_allclose(viewer.nodes["/obstacles/ball"]["position"], [0.6, 0.1, 0.5], atol=1e-6)
    viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][2] < 1.9, "the cube's fall")
    viewer.press("pause")
    viewer.wait(lambda: session.stepper.paused and session.stepper.work is None, "a hold")
    place = 10.0 * np.add([0.2, 0.0, 0.2], session.last.poses["cube"].translation)
    node = viewer.nodes["/obstacles/cube"]
    viewer.wait(lambda: np.allclose(node["position"], place, atol=1e-5), "the cube where it is")
    half = np.deg2rad(15.0)
    np.testing.assert_allclose(node["wxyz"], [np.cos(half), 0.0, 0.0, np.sin(half)], atol=1e-3)


def test_an_obstacle_of_triangles_is_shown(live: Callable[..., Any], tmp_path: Path) -> None:
    """An obstacle from a file is displayed with its triangles, in the picture's units."""
    file = tmp_path / "tool.stl"
    trimesh.creation.icosahedron().apply_scale(0.01).export(file)
    motion = f"obstacles: {{tool: {{mesh: {{file: {file}}}, at: [0.05, 0, 0.05]}}}}"
    node = live(motion=motion).look().nodes["/obstacles/tool"]
    shape = node["vertices"].reshape(-1, 3)
    assert node["faces"].size == 60
    np.testing.assert_allclose(np.linalg.norm(shape, axis=1), 0.1, rtol=1e-5)


def test_a_refused_value_does_not_stay_in_the_control(live: Callable[..., Any]) -> None:
    """A value beyond a slider's range is refused, and the slider of the viewer goes back to the present command."""
    page = live()
    viewer = page.look()
    label = "lower, tension [N]"
    uuid = viewer.controls[label]["uuid"]
    viewer.move(label, 1.5)
    viewer.wait(lambda: page.session.simulation.commands["lower"] == 1.5, "the command")
    viewer.values[uuid] = 1e6  # what a browser shows after somebody has typed it
    viewer.move(label, 1e6)
    viewer.wait(lambda: viewer.values[uuid] == 1.5, "the command in the slider")
    viewer.wait(lambda: viewer.notes, "the refusal")
    assert "lower, tension [N]: 1000000.0 is given; allowed: a number from 0 to 2" in viewer.notes[-1]


def test_the_state_has_the_present_forces(live: Callable[..., Any]) -> None:
    """With the weight off, the largest reaction falls to nearly zero, and no force is left that has an arrow."""
    viewer = live().look()
    viewer.wait(lambda: viewer.nodes["/reactions/arrows"]["visible"], "the arrow of the weight")
    viewer.move("weight, factor [1]", 0.0)
    viewer.wait(lambda: not viewer.nodes["/reactions/arrows"]["visible"], "no arrow")
    viewer.wait(lambda: _reaction(viewer) < 0.02, "the present reaction")
    assert not viewer.nodes["/reactions/arrows"]["visible"]


def test_errors_of_a_solve_have_no_arrow(live: Callable[..., Any]) -> None:
    """Tendons that pull between points of the body leave reactions of the solve's error: they have no arrow."""
    page = live(body=PULLED_INSIDE)
    session, viewer = page.session, Viewer(page.page.address())
    page.viewers.append(viewer)
    viewer.wait(lambda: "converged" in viewer.text(), "the page")  # the undeformed body gets no further frame
    viewer.move("left, tension [N]", 1.0)
    viewer.wait(lambda: session.simulation.commands["left"] == 1.0 and session.simulation.settled, "the pull")
    viewer.wait(lambda: _reaction(viewer) > 0.0, "its reaction")
    force = np.linalg.norm(session.last.result.reactions["base"][:3])
    assert 0.0 < force < 1e-3
    assert not viewer.nodes["/reactions/arrows"]["visible"]


def test_contact_forces_push_from_without(live: Callable[..., Any]) -> None:
    """With a floor pressed against the bar, the force arrows end at the contact points and sum to the reaction."""
    page = live(motion=TOUCHING.replace("-0.0101]", "-0.0101], friction: 1.0"))
    viewer, session = page.look(), page.session
    viewer.move("weight, factor [1]", 0.0)
    viewer.wait(lambda: not len(session.last.result.contacts["floor"].presses), "a bar that hangs free")
    viewer.wait(lambda: not viewer.nodes["/contact_forces/sticks"]["visible"], "no arrows")
    viewer.drag("floor", [0.0, 0.0, -0.096])
    viewer.wait(lambda: session.last.result.reactions["floor"][2] > 0.01, "a press")
    viewer.wait(lambda: session.simulation.settled, "rest")
    floor = session.last.result.reactions["floor"][:3]
    assert floor[2] > 0.01

    def told() -> bool:
        total = np.diff(_arrows(viewer), axis=1).sum(axis=(0, 1))
        return total[2] > 0.0 and np.allclose(total / total[2], floor / floor[2], atol=0.02)

    viewer.wait(told, "arrows that add up to the reaction")
    arrows = _arrows(viewer)
    assert (np.diff(arrows[:, :, 2], axis=1) > 0.0).all()
    assert arrows[:, 1, 2] == pytest.approx(-0.097, abs=2e-3)


def test_groups_can_be_hidden_where_the_scene_has_them(live: Callable[..., Any]) -> None:
    """The contact forces can be hidden; a scene without contact has no such checkbox."""
    viewer = live(motion=TOUCHING).look()
    viewer.move("contact forces", False)
    viewer.wait(lambda: viewer.nodes["/contact_forces"].get("visible") is False, "the hidden group")
    other = live().look()
    assert {"handles", "probes", "reactions"} <= set(other.controls)
    assert not {"contact forces", "obstacles"} & set(other.controls)


def test_moduli_change_while_it_runs(live: Callable[..., Any], tmp_path: Path) -> None:
    """Halving a modulus reduces the force at the tip; while a bag is written the change is refused."""
    page = live()
    viewer, session = page.look(), page.session
    viewer.wait(lambda: session.simulation.settled, "rest under its weight")
    weight = session.last.result.reactions["tip"][2]
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.2]))
    viewer.wait(lambda: session.last.result.reactions["tip"][2] > 2.0 * weight, "a force")
    viewer.wait(lambda: session.simulation.settled, "rest")
    before = session.last.result.reactions["tip"][2]
    moduli = {name: 0.5 * young for name, young in _moduli(page).items()}
    session.set_moduli(moduli).result()
    assert session.last.result.reactions["tip"][2] - weight == pytest.approx(0.5 * (before - weight), rel=0.05)
    session.record(tmp_path / "bag").result()
    name = next(iter(moduli))
    viewer.move(f"{name} [Pa]", 1e6)
    viewer.press("change the body")
    viewer.wait(lambda: any("a bag is being written" in note for note in viewer.notes), "the refusal")


def test_the_colour_and_its_range(live: Callable[..., Any]) -> None:
    """With the displacement as colour, the legend has its unit, and a held range keeps its limits."""
    page = live()
    viewer = page.look()
    viewer.move("colour", "displacement [m]")
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.1]))
    viewer.wait(lambda: "displacement [m]" in viewer.text() and _largest(viewer) > 0.0, "the legend")
    viewer.move("hold the range", True)
    viewer.wait(lambda: page.page._range.held, "the range held")
    held = page.page._range.high
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.3]))
    frames = viewer.frames
    viewer.wait(lambda: viewer.frames > frames, "another frame")
    assert page.page._range.high == held


def test_viewers_come_and_go_without_a_trace(live: Callable[..., Any]) -> None:
    """After ten viewers at once and thirty in turn, no thread is left, and the count of viewers is right."""
    page = live()
    first = page.look()
    threads = threading.active_count()
    with_ten = [Viewer(page.page.address()) for _ in range(10)]
    for viewer in with_ten:
        viewer.wait(lambda viewer=viewer: viewer.frames, "a frame")
    first.wait(lambda: page.page.viewers == 11, "all to be counted")
    for viewer in with_ten:
        viewer.__exit__(None, None, None)
    for _ in range(30):
        with Viewer(page.page.address()) as viewer:
            viewer.wait(lambda viewer=viewer: viewer.frames, "a frame")
    first.wait(lambda: page.page.viewers == 1, "all others gone")
    assert page.page.viewers == 1
    # What the operating system lists beyond those of viewers in this process, whose sockets have a thread each.
    first.wait(lambda: threading.active_count() <= threads, "their threads gone")
    assert threading.active_count() <= threads


def test_garbage_on_the_socket_is_told_in_a_line(live: Callable[..., Any], caplog: Any) -> None:
    """Invalid HTTP and invalid messages on a viewer's socket give no traceback, and the page continues."""
    page = live()
    for garbage in (b"\x00\xff" * 100, b"GET / HTTP/1.1\r\nConnection: Upgrade\r\n\r\n", b"\r\n\r\n"):
        with socket.create_connection(("127.0.0.1", page.page.port)) as stranger:
            stranger.sendall(garbage)
            stranger.settimeout(2.0)
            with contextlib.suppress(TimeoutError):
                stranger.recv(1000)
    for garbage in (b"\xc1\x00garbage", "text", b""):
        with contextlib.suppress(ConnectionClosed), Viewer(page.page.address()) as viewer:
            viewer.socket.send(garbage)
            viewer.socket.recv(timeout=5.0)
    page.look().wait(lambda: page.page.viewers >= 1, "the page")
    assert not any(record.exc_info or "Traceback" in record.getMessage() for record in caplog.records)


def test_a_viewer_that_hangs_holds_nobody_up(live: Callable[..., Any]) -> None:
    """A viewer that receives nothing delays neither the steps nor the frames of another viewer."""
    page = live()
    viewer = page.look()
    _hanging(page)
    viewer.press("play the program")
    viewer.wait(lambda: page.session.playing is None and page.session.last.record.time >= 1.0, "the program's end")
    frames = viewer.frames
    assert frames > 20
    assert len(page.page._server._websock_server._broadcast_buffer.message_from_id) < 500


def test_the_body_is_seen_before_it_can_move(bar: str) -> None:
    """A page without a run shows the undeformed body and that the run is being built; a drag gives that note."""
    scene = scene_from_text(bar, origin="of a test")
    page = Page(host="127.0.0.1", port=8600, frames=30.0)
    session = None
    try:
        page.lay_out(scene, scene.name)
        with Viewer(page.address()) as viewer:
            viewer.wait(lambda: "is being built" in viewer.text() and "/handles/tip" in viewer.nodes, "the page")
            surface = DrawnSurface(scene.mesh, scale=10.0)
            np.testing.assert_allclose(viewer.surface(), 10.0 * surface.outside.at(scene.mesh.vertices), atol=1e-6)
            for height in (0.2, 0.3):
                viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, height]))
            viewer.wait(lambda: viewer.notes, "a note")
            assert viewer.notes == ["the body is being built"]
            session = LiveSession(Simulation(scene), on_view=page.show_view, warn=page.say)
            page.show(session)
            session.start()
            viewer.wait(lambda: "converged" in viewer.text() and "lower, tension [N]" in viewer.controls, "the run")
            assert "is being built" not in viewer.text()
            assert len(viewer.notes) == 1
            viewer.wait(lambda: viewer.place("tip")[2] == 0.0, "the control back at its target")
    finally:
        if session is not None:
            session.stop()
        page.close()


def test_a_slider_moves_the_body_at_once(live: Callable[..., Any]) -> None:
    """A tendon pulled by its slider bends the displayed surface at once, even if viser collects for ten minutes."""
    page = live()
    viewer = page.look()
    page.page._server._websock_server._broadcast_buffer.window_duration_sec = 600.0
    rest, shown = viewer.surface().copy(), viewer.nodes["/body/0"]["visible"]
    viewer.move("lower, tension [N]", 1.5)
    viewer.wait(lambda: np.abs(viewer.surface() - rest).max() > 1e-4, "a bent bar", patience=60.0)
    assert viewer.wait(lambda: viewer.nodes["/body/0"]["visible"] != shown, "its turn", patience=60.0)
    assert page.session.simulation.commands["lower"] == 1.5


def test_a_port_that_is_taken_is_passed_over() -> None:
    """If the port is in use, the page takes the next one."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        page = Page(host="127.0.0.1", port=port, frames=30.0)
        page.close()
    assert page.port != port


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nothing_like_it"], "nothing_like_it"),
        (["bend5", "--port", "70000"], "allowed: 1 to 65535"),
        (["bend5", "--fps", "0"], "allowed: 1 to 60"),
        (["bend5", "--dt", "-1"], "allowed: 1e-6 to 1000"),
        ([], "allowed: a scene, or --ros"),
        (["--ros", "a b"], "allowed: letters, digits"),
        (["--ros", ""], "allowed: letters, digits"),
        (["bend5", "--ros", "gdfe_sim"], "allowed: a scene, or --ros"),
        (["--ros", "gdfe_sim", "--fast", "--set", "name=x"], "--fast, --set cannot stand beside --ros"),
        (["bend5", "--host", "203.0.113.7"], "allowed: an address of this machine"),
        (["bend5", "--host", "no.such.host.example"], "allowed: an address of this machine"),
        (["drop", "--set", "program=null", "--play"], "add the key 'program'"),
    ],
)
def test_bad_arguments_are_told(arguments: list[str], text: str, capsys: Any) -> None:
    """Invalid arguments give status 2 and one message with the allowed values."""
    assert main(["live", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_the_command_shows_a_scene_until_it_is_interrupted() -> None:
    """The command shows its address, and ends after an interrupt with status 0 and an empty stderr."""
    command = [sys.executable, "-m", "gdfe_ros.cli", "live", "bend5", "--port", "8670"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().split()[2]
        with Viewer(address) as viewer:
            viewer.wait(lambda: "converged" in viewer.text() and "/handles/tip" in viewer.nodes, "the page")
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
        assert (process.stdout.read(), process.stderr.read()) == ("", "")
    finally:
        process.kill()
        process.wait()


def _hanging(page: Any) -> Viewer:
    viewer = Viewer(page.page.address())
    page.viewers.append(viewer)
    viewer.wait(lambda: viewer.frames, "a frame")
    return viewer


def _arrows(viewer: Viewer) -> Any:
    """Return the ends of the contact arrows (k, 2, 3), in the picture's units."""
    nodes = [viewer.nodes[f"/contact_forces/{kind}"] for kind in ("sticks", "slips")]
    seen = [node["points"].reshape(-1, 2, 3) for node in nodes if node["visible"]]
    return np.concatenate([np.zeros((0, 2, 3)), *seen])


PULLED_INSIDE = """
name: pulled_inside
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [6, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 0.5e6, poisson: 0.45}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
actuators: {left: {cable: {points: [[0.02, 0.008, 0], [0.08, 0.008, 0]], range: [0, 2]}}}
"""
"""A bar with a tendon between two of its points, so that the base holds it without a force."""


def _reaction(viewer: Viewer) -> float:
    """Return the largest reaction [N] in the state."""
    return float(re.search(r"largest of reactions</td><td>([-+.\de]+) N", viewer.text())[1])


def _largest(viewer: Viewer) -> float:
    numbers = re.findall(r"<span>([-\d.e]+)</span>", viewer.text())
    return float(numbers[-1]) if numbers else 0.0


def _moduli(page: Any) -> dict[str, float]:
    from gdfe_ros.node.driving.remodelling import moduli_of

    return moduli_of(page.session.scene)


def test_a_dragged_probe_is_followed_by_the_actuators(live: Callable[..., Any]) -> None:
    """A probe is dragged to where tendons of 1 N hold it and goes there; the page says if it is out of reach."""
    page = live()
    viewer, simulation = page.look(), page.session.simulation
    other = Simulation(simulation.scene)
    other.step(Command(actuators={"lower": 1.0}))
    goal, scale = other.probe_positions()["middle"], 10.0 ** round(-np.log10(simulation.mesh.size))
    viewer.drag_probe("middle", scale * goal)
    viewer.wait(lambda: abs(sum(simulation.commands[name] for name in ("lower", "left")) - 1.0) < 0.05, "the tensions")
    assert np.linalg.norm(simulation.probe_positions()["middle"] - goal) < 2e-5
    viewer.drag_probe("middle", scale * goal + np.array([5.0, 0.0, 0.0]))
    viewer.wait(lambda: any("nearest point so far" in note for note in viewer.notes), "a note")


def test_the_ground_has_a_scale(live: Callable[..., Any]) -> None:
    """Without a plane in the scene, squares of a round length lie below the body, and their length is written there."""
    page = live()
    viewer, mesh = page.look(), page.session.scene.mesh
    squares, edge = viewer.nodes["/ground/squares"], round_length(0.3 * mesh.extent)
    assert squares["cell_size"] == pytest.approx(edge * scale_of(mesh))
    assert squares["position"][2] < scale_of(mesh) * mesh.bounds[0, 2]
    assert viewer.nodes["/ground/edge"]["text"] == f"squares of {1e3 * edge:g} mm"
    assert [round_length(value) for value in (0.03, 0.0199, 0.5, 0.999)] == pytest.approx([0.02, 0.01, 0.5, 0.5])


BALL = """
name: ball
mesh: {sphere: {inner: 0.010, outer: 0.015, cells: [4, 3]}}
materials: {m: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: m}]
handles: {base: {where: {vertices: [0]}, fixed: true}}
actuators: {air: {chamber: {command: pressure, range: [0, 2.0e4]}}}
"""


def test_the_walls_of_chambers_are_seen_through_the_body(live: Callable[..., Any]) -> None:
    """A slider inflates the wall of a chamber, which is inside a translucent body and turns blue; it can be hidden."""
    page = live(body=BALL)
    viewer, scene = page.look(), page.session.scene
    wall, scale = viewer.nodes["/chambers/air"], scale_of(scene.mesh)

    def radii() -> Any:
        return np.linalg.norm(wall["vertices"].reshape(-1, 3), axis=1) / scale

    def look() -> bytes:
        return viewer.nodes[f"/body/{viewer.last}"]["glb_data"]

    assert wall["faces"].max() + 1 == len(radii()) == len(np.unique(scene.actuators[0].quads))
    assert radii() == pytest.approx(0.010, rel=1e-5)
    assert b'"alphaMode":"BLEND"' in look()
    pale = wall["color"]
    viewer.move("air, pressure [Pa]", 5000.0)
    viewer.wait(lambda: radii().mean() > 0.0105, "a larger chamber")
    assert wall["color"][0] < pale[0]
    viewer.move("chambers", False)
    viewer.wait(lambda: b'"alphaMode":"OPAQUE"' in look(), "an opaque body")
    assert viewer.nodes["/chambers"]["visible"] is False
