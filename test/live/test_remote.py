# SPDX-License-Identifier: Apache-2.0
"""The live page of a node in another process: displays and commands."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import WebSocketException

from gdfe_ros.cli import main
from gdfe_ros.errors import GdfeError
from gdfe_ros.live.page import Page
from gdfe_ros.live.remote.commander import Player
from gdfe_ros.live.remote.node_session import NodeSession
from gdfe_ros.node.driving.orders import ActuatorOrder
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.step import Begin, StepRecord
from gdfe_ros.scene import scene_from_text
from gdfe_ros.testing import NodeProcess
from gdfe_ros.testing.client import NodeConnection
from test.live.viewer import Viewer

FLOOR = "obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.02]}}\n"
OTHER = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[20, 2, 2]"]}


class Shown:
    """A node in its own process, its page in this process, and a viewer."""

    def __init__(self, parameters: dict[str, Any]) -> None:
        self.parameters, self.process = parameters, NodeProcess(parameters)
        self.session = NodeSession("gdfe_sim", patience=120.0)
        self.page = Page(host="127.0.0.1", port=8650, frames=30.0)
        self.page.show(self.session)
        self.session.start(on_view=self.page.show_view, warn=self.page.say)
        self.viewer = Viewer(self.page.address())
        self.viewer.wait(lambda: self.viewer.frames and "converged" in self.viewer.text(), "the page")

    def close(self) -> None:
        """Close the viewer, the session, the page and the node."""
        self.viewer.__exit__(None, None, None)
        self.session.stop()
        self.page.close()
        self.process.stop()


@pytest.fixture
def shown(bar: str, tmp_path: Path) -> Iterator[Callable[..., Shown]]:
    """Give a function that shows a node with the bar above a floor."""
    scene = tmp_path / "pulled.yaml"
    scene.write_text(bar + FLOOR)
    made: list[Shown] = []

    def make(**parameters: Any) -> Shown:
        made.append(Shown({"scene": str(scene), **parameters}))
        return made[-1]

    yield make
    for each in made:
        each.close()


def test_a_node_is_seen_and_commanded(shown: Callable[..., Shown]) -> None:
    """The node follows a slider, a dragged tip and a pressed floor, and the viewer sees all of it."""
    page = shown()
    viewer, session = page.viewer, page.session
    rest = viewer.surface().copy()
    viewer.move("lower, tension [N]", 1.5)
    viewer.wait(lambda: session.commands["lower"] == 1.5, "the slider's command in a step record")
    viewer.wait(lambda: np.abs(viewer.surface() - rest).max() > 1e-4, "a bent bar")
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.3]))
    viewer.wait(lambda: session.targets["tip"].translation[2] == pytest.approx(0.03), "the drag")
    viewer.wait(lambda: viewer.surface()[:, 2].max() > 0.38, "a lifted tip")
    assert viewer.nodes["/reactions/arrows"]["visible"]
    viewer.drag("floor", [0.0, 0.0, -0.05])
    viewer.wait(lambda: abs(viewer.nodes["/obstacles/floor"]["position"][2] + 0.05) < 1e-3, "the floor's way")
    kinds = [viewer.nodes[f"/contact_forces/{kind}"] for kind in ("sticks", "slips")]
    viewer.wait(lambda: any(node["visible"] for node in kinds), "contact forces")


def test_a_body_in_motion_is_seen(shown: Callable[..., Shown], bar: str, tmp_path: Path) -> None:
    """A cube that falls beside a swinging bar is drawn at its pose, and the speed colours the bar."""
    scene = tmp_path / "moving.yaml"
    cube = "{box: {size: [0.01, 0.01, 0.01]}, density: 500, at: [0.2, 0, 0.2]}"
    scene.write_text(
        f"{bar}{FLOOR}bodies: {{cube: {cube}}}\nsensors: {{pad: {{where: {{face: z-}}}}}}\ndynamics: {{}}\n"
    )
    viewer = shown(scene=str(scene), publish_clock=True).viewer
    viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][2] < 1.9, "the cube's fall")
    viewer.move("colour", "speed [m/s]")
    viewer.wait(lambda: "speed [m/s]" in viewer.text(), "the legend")
    viewer.drag("cube", [2.0, 1.0, 3.0])
    viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][1] > 0.99, "the cube where it was put")
    assert viewer.wait(lambda: viewer.nodes["/obstacles/cube"]["position"][2] < 2.9, "its fall from there")


def test_a_page_that_nobody_looks_at_hears_no_meshes(shown: Callable[..., Shown]) -> None:
    """The page subscribes to the node's mesh only while there is a viewer."""
    page = shown()
    rest = page.viewer.surface().copy()
    page.viewer.__exit__(None, None, None)
    _await(lambda: page.session._node.count_subscribers("/gdfe_sim/mesh") == 0)
    before = page.session.commands["lower"]
    page.session.command("lower", ActuatorOrder({"lower": before + 1.0}))
    _await(lambda: page.session.commands["lower"] == before + 1.0)
    page.viewer = viewer = Viewer(page.page.address())
    uuid = viewer.wait(lambda: viewer.controls.get("lower, tension [N]"), "the page")["uuid"]
    viewer.wait(lambda: viewer.values[uuid] == before + 1.0, "the slider")
    viewer.wait(lambda: np.abs(viewer.surface() - rest).max() > 1e-4, "a bent bar")
    assert viewer.values[uuid] == before + 1.0


def test_what_others_command_is_shown(shown: Callable[..., Shown]) -> None:
    """Commands of another client move the slider and the control, which send no command themselves."""
    page = shown()
    viewer = page.viewer
    uuid = viewer.controls["left, tension [N]"]["uuid"]
    with NodeSession("gdfe_sim", patience=60.0) as other:
        other.start(on_view=lambda view: None, warn=print)
        viewer.wait(other._commander._actuation.get_subscription_count, "the node to listen")
        other.command("left", ActuatorOrder({"left": 0.75}))
        viewer.wait(lambda: viewer.values[uuid] == 0.75, "the slider")
    assert page.session.commands["lower"] == 0.0


def test_buttons_call_services(shown: Callable[..., Shown], tmp_path: Path) -> None:
    """The buttons record, pause, step and reset through the node's services, and a bag is written."""
    page = shown(bag_path=str(tmp_path / "bag"), publish_clock=True)
    viewer, session = page.viewer, page.session
    viewer.press("record")
    viewer.wait(lambda: "finish the bag" in viewer.controls, "the bag")
    assert session.recording == str(tmp_path / "bag")
    viewer.press("finish the bag")
    viewer.wait(lambda: session.recording is None, "the bag's end")
    assert BagReader(tmp_path / "bag").topics
    viewer.press("pause")
    viewer.wait(lambda: "go on" in viewer.controls and "paused" in viewer.text(), "the pause")
    viewer.press("reset")
    viewer.wait(lambda: session.state.record.time == 0.0, "the reset")
    viewer.press("one step")
    viewer.wait(lambda: session.state.record.time == pytest.approx(0.01), "one step")
    viewer.press("go on")
    viewer.wait(lambda: session.state.record.time > 0.05, "time to go on")


def test_the_program_is_played_to_a_node(shown: Callable[..., Shown]) -> None:
    """During a program played to the node, a moved tendon keeps its command, and the rest follows the program."""
    page = shown()
    viewer, session = page.viewer, page.session
    viewer.press("play the program")
    viewer.wait(lambda: "plays the program" in viewer.text(), "the program")
    viewer.move("lower, tension [N]", 1.25)
    viewer.wait(lambda: session.commands["left"] == 1.0 and "plays" not in viewer.text(), "the program's end")
    assert session.commands["lower"] == 1.25
    assert session.targets["tip"].translation == pytest.approx((0.0, 0.0, 0.02))
    viewer.press("play the program")
    viewer.wait(lambda: session.commands["left"] < 1.0, "the program again")
    viewer.press("reset")
    viewer.wait(lambda: session.state.record.time < 0.5 and "plays" not in viewer.text(), "the reset")


def test_what_no_step_follows_is_commanded_again(bar: str) -> None:
    """If no record of a step arrives, the program's start is sent again, without handles that the viewer commands."""
    sent: list[str] = []
    player = Player(scene_from_text(bar), lambda name, order: sent.append(name))
    player.play()
    assert sent == ["tip", "program"]
    player.leave(["tip"])
    end = time.monotonic() + 60.0
    while len(sent) == 2 and time.monotonic() < end:
        player.remind()
    assert sent == ["tip", "program", "program"]
    player.stop()
    player.remind()
    assert len(sent) == 3


def test_nothing_is_commanded_that_was_left_to_the_viewer(bar: str) -> None:
    """A program's order that is being sent arrives before its tendon is left to the viewer."""
    happened: list[str] = []
    viewers: list[threading.Thread] = []

    def leave() -> None:
        player.leave(["lower"])
        happened.append("left")

    def send(name: str, order: Any) -> None:
        if name == "program":
            viewers.append(threading.Thread(target=leave))
            viewers[-1].start()
            viewers[-1].join(0.2)
        happened.append(name)

    player = Player(scene_from_text(bar), send)
    player.play()
    viewers[-1].join()
    assert happened == ["tip", "program", "left"]


def test_the_end_of_a_program_is_commanded_though_the_word_of_steps_is_lost(bar: str) -> None:
    """If the records of the last steps are lost, the program's end is still commanded once."""
    sent: list[tuple[str, Any]] = []
    player = Player(scene_from_text(bar), lambda name, order: sent.append((name, order)))
    player.play()
    for step, moment in enumerate((0.0, 0.1, 5.0, 5.1)):
        player.follow(StepRecord(step=step + 1, begin=Begin.LAST, time=moment, dt=0.1, stamp=0))
    assert not player.text
    last = {name: order for name, order in sent}
    assert last["tip"].translation == pytest.approx((0.0, 0.0, 0.02))
    assert last["program"].values["left"] == 1.0
    assert [name for name, _ in sent].count("tip") == 4


def test_a_program_that_leads_too_far_ends_with_a_note(shown: Callable[..., Shown], bar: str, tmp_path: Path) -> None:
    """A program that moves the tip too far ends there with a note, and the page continues."""
    scene = tmp_path / "far.yaml"
    scene.write_text(bar.replace("translation: [0, 0, 0.02]", "translation: [0, 0, 10.0]"))
    page = shown(scene=str(scene))
    viewer, session = page.viewer, page.session
    viewer.press("play the program")
    viewer.wait(lambda: any("the program ends here" in note for note in viewer.notes), "a note")
    viewer.press("reset")
    viewer.wait(lambda: session.state.record.time < 0.5 and "plays" not in viewer.text(), "the reset")
    assert session.failure is None


def test_moduli_of_a_node_are_its_parameters(shown: Callable[..., Shown], tmp_path: Path) -> None:
    """A modulus changed on the page or by another client changes the force; it is refused while a bag is written."""
    page = shown(bag_path=str(tmp_path / "bag"))
    viewer, session = page.viewer, page.session
    weight = session.state.wrenches["tip"][2]
    viewer.drag("tip", np.add(viewer.place("tip"), [0.0, 0.0, 0.2]))
    viewer.wait(lambda: session.state.wrenches["tip"][2] > 1.5 * weight, "a force")
    viewer.wait(lambda: session.state.record.converged and not session.state.record.handles, "rest")
    before = session.state.wrenches["tip"][2]
    viewer.move("rubber [Pa]", 0.25e6)
    viewer.press("change the body")
    viewer.wait(lambda: session.moduli == {"rubber": 0.25e6}, "the node's new scene")
    viewer.wait(lambda: session.state.wrenches["tip"][2] < weight + 0.6 * (before - weight), "half the force")
    with NodeSession("gdfe_sim", patience=60.0) as other:
        assert other.moduli == {"rubber": 0.25e6}
        other.start(on_view=lambda view: None, warn=print)
        viewer.wait(other._commander._parameters.services_are_ready, "the node to listen")
        other.set_moduli({"rubber": 0.75e6}).result(60.0)
    uuid = viewer.controls["rubber [Pa]"]["uuid"]
    viewer.wait(lambda: viewer.values[uuid] == 0.75e6, "the number that somebody else has set")
    viewer.press("record")
    viewer.wait(lambda: "finish the bag" in viewer.controls, "the bag")
    viewer.move("rubber [Pa]", 1e6)
    viewer.press("change the body")
    viewer.wait(lambda: any("a bag is being written" in note for note in viewer.notes), "the refusal")
    assert not session.outdated


def test_a_node_that_is_killed_is_told_in_a_note(shown: Callable[..., Shown]) -> None:
    """After the node is killed, a note says that nothing is heard; after its restart another note follows."""
    page = shown()
    viewer = page.viewer
    page.process.kill()
    viewer.wait(lambda: any("nothing is heard of /gdfe_sim any more" in note for note in viewer.notes), "a note")
    with NodeProcess(page.parameters):
        viewer.wait(lambda: any("/gdfe_sim is heard again" in note for note in viewer.notes), "another note")
    texts = ("nothing is heard of /gdfe_sim any more", "/gdfe_sim is heard again")
    assert [text for note in viewer.notes for text in texts if text in note] == list(texts)


def test_what_the_node_refuses_is_told(shown: Callable[..., Shown]) -> None:
    """A step refused by the running node gives a note with the node's reason."""
    viewer = shown().viewer
    viewer.press("one step")
    viewer.wait(lambda: viewer.notes, "a note")
    assert "/gdfe_sim/step: " in viewer.notes[0]


def test_a_node_that_goes_is_told_of(shown: Callable[..., Shown]) -> None:
    """If the node ends, the page says so; it continues with the restarted node, but not with another scene."""
    page = shown()
    viewer = page.viewer
    page.process.stop()
    viewer.wait(lambda: "nothing heard of /gdfe_sim" in viewer.text(), "silence to be told of")
    viewer.press("pause")
    viewer.wait(lambda: any("is the node /gdfe_sim running" in note for note in viewer.notes), "a note")
    with NodeProcess(page.parameters):
        viewer.wait(lambda: "nothing heard" not in viewer.text(), "its return")
        viewer.wait(lambda: page.session._commander._actuation.get_subscription_count(), "the node to listen")
        viewer.move("left, tension [N]", 1.25)
        viewer.wait(lambda: page.session.commands["left"] == 1.25, "its command")
        assert not page.session.outdated
    with NodeProcess(OTHER):
        viewer.wait(lambda: page.session.outdated, "the other scene")


def test_no_such_node_is_told_with_those_there_are(capsys: Any) -> None:
    """A missing node gives status 2, with its name, the domain, and how to start one."""
    with NodeProcess(OTHER, namespace="/left"):
        with NodeSession("left/gdfe_sim", patience=120.0) as session:
            assert session.scene.name == "bend5"
        assert main(["live", "--ros", "nobody"]) == 2
    error = capsys.readouterr().err
    assert "no node /nobody within 5 s; nodes that simulate: /left/gdfe_sim (ROS domain" in error
    assert "start one: sim_node --ros-args" in error


def test_a_node_that_is_not_configured_is_told() -> None:
    """A node that stays unconfigured is reported while waiting and at the end, with a remedy."""
    there = "is not configured; remedy: gdfe lifecycle /gdfe_sim configure"
    said: list[str] = []
    with (
        NodeProcess({**OTHER, "autostart": False}) as process,
        NodeConnection(process, "/gdfe_sim", {}, patience=120.0) as link,
    ):
        link.meet()
        with pytest.raises(GdfeError, match=there):
            NodeSession("gdfe_sim", patience=5.0, say=said.append)
    assert "the node /gdfe_sim is unconfigured; it publishes its scene after: gdfe lifecycle" in said[0]


def test_a_node_that_is_not_active_is_shown_at_rest() -> None:
    """For an inactive node the page shows the undeformed body and the state inactive."""
    with (
        NodeProcess({**OTHER, "autostart": False}) as process,
        NodeConnection(process, "/gdfe_sim", {}, patience=120.0) as link,
    ):
        link.meet()
        link.transition("configure")
        with NodeSession("gdfe_sim", patience=60.0) as session:
            page = Page(host="127.0.0.1", port=8650, frames=30.0)
            page.show(session)
            session.start(on_view=page.show_view, warn=page.say)
            with Viewer(page.address()) as viewer:
                viewer.wait(lambda: "inactive" in viewer.text() and "/handles/tip" in viewer.nodes, "the page")
                link.transition("activate")
                viewer.wait(lambda: "converged" in viewer.text() and "inactive" not in viewer.text(), "its steps")
                assert "inactive" not in viewer.text()
            page.close()


def test_the_command_shows_the_next_scene_at_the_same_address(bar: str, tmp_path: Path) -> None:
    """If the node is replaced by one with another scene, the command's page follows; a signal ends it with status 0."""
    scene = tmp_path / "pulled.yaml"
    scene.write_text(bar)
    with NodeProcess({"scene": str(scene)}):
        NodeSession("gdfe_sim", patience=120.0).stop()  # the command waits for seconds only
        command = [sys.executable, "-m", "gdfe_ros.cli", "live", "--ros", "--port", "8660"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        address = process.stdout.readline().split()[2]
        with Viewer(address) as viewer:
            viewer.wait(lambda: "lower, tension [N]" in viewer.controls and "converged" in viewer.text(), "the page")
    try:
        with NodeProcess(OTHER):
            with _next_page(address) as viewer:
                assert "/handles/tip" in viewer.nodes
            process.send_signal(signal.SIGINT)
            assert process.wait(60.0) == 0
            assert process.stdout.read() == ""
    finally:
        process.kill()
        process.wait()


def _await(done: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def _next_page(address: str) -> Viewer:
    """Connect to an address until its page has no sliders of the bar; return the viewer."""
    end = time.monotonic() + 120.0
    while time.monotonic() < end:
        with contextlib.suppress(OSError, WebSocketException):  # while one page goes and the next one comes
            viewer = Viewer(address)
            viewer.wait(lambda viewer=viewer: "converged" in viewer.text(), "a page", patience=10.0)
            if "lower, tension [N]" not in viewer.controls:
                return viewer
            viewer.__exit__(None, None, None)
        time.sleep(0.2)
    raise TimeoutError("the other scene's page did not come")
