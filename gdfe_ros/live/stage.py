# SPDX-License-Identifier: Apache-2.0
"""The 3-D view: body, draggable handles, probes with traces, obstacles, forces."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.actuator import Chamber
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.form import Plane
from gdfe_ros.constraints.obstacle import ArmLink, Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.live.interface import View
from gdfe_ros.live.solids import Arms, Arrows, Chambers, Solids, turn_of
from gdfe_ros.live.surface import AlternatingBody, DrawnSurface, RealRobot
from gdfe_ros.mesh import HexMesh
from gdfe_ros.node.driving.orders import PoseOrder, TeleportOrder
from gdfe_ros.node.interface.topics import is_commanded
from gdfe_ros.results.contacts import contact_names, places_and_forces
from gdfe_ros.scene.scene import Scene

HANDLES, PROBES, REACTIONS, CONTACTS, SOLIDS = "handles", "probes", "reactions", "contact forces", "obstacles"
ARMS, GROUND, CHAMBERS = "arms", "ground", "chambers"
CONTROL = 0.22
"""Length of the arrows of a handle's control, divided by the body's size."""
GOAL = 0.14
"""Length of the arrows of a probe's control, divided by the body's size."""
_EYE = np.array([-0.55, -1.15, 0.65])
"""Position of the camera relative to the centre of the scene, divided by the extent of the scene."""
_SQUARE = 0.3
"""Edge of a square of the ground, at most, divided by the body's extent; the edge is 1, 2 or 5 times a power of ten."""
_DEPTH = 0.6
"""Distance of the ground below the undeformed body, divided by the body's extent; bent bodies are above it."""
_SQUARES = 16
"""Number of squares along each side of the ground."""
_FAINT = 0.45
"""Opacity of the controls of probes, so low that the probe stays visible."""
_TRACE = 400
"""Largest number of points of a probe's trace."""
_GRAIN = 2e-3
"""Smallest distance between two points of a trace, divided by the body's size."""
_TOUCHED = 0.7
"""After a viewer's drag, a control keeps the viewer's pose for this time [s]."""
_NOISE = 0.5
"""Largest reaction that counts as an error of the solve, divided by Young's modulus, the square of the body's size, and
the error estimate. An unloaded clamped bar of rubber reaches 0.4.
"""
_ROUNDING = 1e-13
"""Least error estimate for the noise of forces: in its rest shape, a body has errors of rounding only."""
_ORANGE = (240, 140, 20)
_HELD = {"arrows": (40, 80, 200)}
_TOUCHES = {"sticks": (25, 180, 50), "slips": (230, 25, 25)}
"""Dict from the kind of a contact point to the colour of its arrow: red, green and blue, 0 to 255."""


class Stage:
    """The 3-D view, in units in which the body's size is about 1.

    Two glTF objects are used in turn. A browser shows nothing while it reads a glTF, so it reads the next frame into
    the hidden object while the other object is visible.

    Args:
        server: server of the page.
        scene: scene of the simulation.
        dragged: function that is called when a viewer drags a handle, obstacle or rigid body, with its name and order.
        aimed: function that is called when a viewer drags a probe, with its name and the new position (3,) [m].

    Attributes:
        surface: drawn surface of the body.
        body: the objects that show frames of this surface in turn.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        scene: Scene,
        *,
        dragged: Callable[[str, PoseOrder | TeleportOrder], None],
        aimed: Callable[[str, NDArray[np.float64]], None],
    ) -> None:
        self._scene, self._dragged, self._aimed = scene, dragged, aimed
        self._scale = scale_of(scene.mesh)
        self._size = scene.mesh.size * self._scale
        self.surface = DrawnSurface(scene.mesh, scale=self._scale)
        self._space = server.scene
        server.initial_camera.look_at, server.initial_camera.position = first_view(scene)
        self._light()
        first = self.surface.pack(scene.mesh.vertices, np.zeros(self.surface.count))
        self.body, self._time = AlternatingBody(self._space, "/body", first), 0.0
        self._held = [handle for handle in scene.handles if not isinstance(handle, Obstacle)]
        self._groups = {name: self._space.add_frame(_path(name), show_axes=False) for name in _groups_of(scene)}
        if GROUND in self._groups:
            self._add_ground()
        self._rests = {handle.name: handle.centre(scene.mesh.vertices) for handle in scene.handles}
        self._touched: dict[str, float] = {}
        self._bodily = [body.name for body in scene.rigid_bodies]
        self._softest = min(material.young0 for material in scene.materials.values())
        self._controls = {handle.name: self._control(handle) for handle in scene.handles if _is_dragged(handle)}
        self._paths: dict[str, deque[NDArray[np.float64]]] = {name: deque(maxlen=_TRACE) for name in scene.probes}
        self._arrows = {
            name: Arrows(self._space, _path(name), colours, size=self._size, thin=thin)
            for name, colours, thin in ((REACTIONS, _HELD, 1.0), (CONTACTS, _TOUCHES, 0.5))
            if name in self._groups
        }
        self._solids = Solids(self._space, _path(SOLIDS), scene, scale=self._scale)
        self._arms = Arms(self._space, _path(ARMS), scene, scale=self._scale)
        self._chambers: Chambers | None = None
        if CHAMBERS in self._groups:
            self._chambers = Chambers(self._space, _path(CHAMBERS), scene, scale=self._scale)
            self.show(CHAMBERS, True)
        self._robot: RealRobot | None = None
        self._probes = self._traces = None
        if scene.probes:
            points, size = np.zeros((len(scene.probes), 3), np.float32), 0.03 * self._size
            self._probes = self._space.add_point_cloud(
                "/probes/points", points, _ORANGE, point_size=size, point_shape="rounded", precision="float32"
            )
            self._traces = self._space.add_line_segments(
                "/probes/traces", np.zeros((1, 2, 3), np.float32), _ORANGE, thickness=2.0, thickness_units="screen"
            )
        led = scene.probes if scene.actuators else {}
        self._goals = {name: self._goal(name, point.at(scene.mesh.vertices)[0]) for name, point in led.items()}

    def mark(self, view: View) -> None:
        """Move probes, obstacles, rigid bodies, links and arrows to their positions after a step."""
        if self._probes is not None:
            points = np.concatenate([point.at(view.positions) for point in self._scene.probes.values()])
            self._probes.points = (self._scale * points).astype(np.float32)
            self._follow(view.record.time, self._scale * points)
            for name, point in zip(self._scene.probes, points, strict=True):
                if name in self._goals and monotonic() - self._touched.get(_goal_of(name), -math.inf) > _TOUCHED:
                    self._goals[name].position = self._scale * point
        self._solids.move(view.poses, view.positions)
        self._arms.move(view.joints)
        if self._chambers is not None and self._groups[CHAMBERS].visible:
            self._chambers.draw(view.positions, view.actuators)
        self.lead({name: view.poses[name] for name in self._bodily})
        self._draw_reactions(view)
        self._draw_contacts(view)

    def compare(
        self, places: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], body: NDArray[np.float64] | None
    ) -> None:
        """Draw a real robot: its measured points, their distances from the simulated ones, and its body (n, 3) [m]."""
        if self._robot is None:
            self._robot = RealRobot(self._space, self._scene.mesh, scale=self._scale, size=self._size)
        self._robot.draw(places, body)

    def trace(self) -> None:
        """Draw the traces."""
        if self._traces is None:
            return
        lines = [
            np.stack([path[:-1], path[1:]], axis=1) for path in map(np.array, self._paths.values()) if len(path) > 1
        ]
        self._traces.visible = bool(lines)
        if lines:
            self._traces.points = np.concatenate(lines).astype(np.float32)

    def lead(self, targets: Mapping[str, Pose]) -> None:
        """Move the controls of handles to their targets, except those that a viewer drags."""
        for name, target in targets.items():
            if name in self._controls and monotonic() - self._touched.get(name, -math.inf) > _TOUCHED:
                self._controls[name].position = self._scale * (self._rests[name] + target.translation)
                self._controls[name].wxyz = turn_of(Rotation.from_rotvec(target.rotation))

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups of objects that can be hidden."""
        return tuple(self._groups)

    def largest(self) -> dict[str, float]:
        """Return a dict from a group of arrows to the largest of its present forces [N]."""
        return {name: arrows.largest for name, arrows in self._arrows.items()}

    def show(self, group: str, wanted: bool) -> None:
        """Show or hide a group of objects, one of `groups`. The body is translucent while chambers are shown."""
        self._groups[group].visible = wanted
        if group == CHAMBERS:
            self.surface.be_translucent(wanted)

    def _light(self) -> None:
        """Light the body without shadows and reflections, so that its colours match the legend."""
        self._space.configure_environment_map(None)
        self._space.configure_default_lights(False)
        self._space.add_light_hemisphere("/light/sky", intensity=1.6)
        self._space.add_light_directional("/light/sun", position=(-1.0, -2.0, 3.0), intensity=1.6)

    def _add_ground(self) -> None:
        """Draw squares below the undeformed body, and the length of their edges."""
        mesh = self._scene.mesh
        edge, middle = round_length(_SQUARE * mesh.extent), mesh.bounds.mean(axis=0)
        middle[2] = mesh.bounds[0, 2] - _DEPTH * mesh.extent
        side, line = _SQUARES * edge * self._scale, (205, 210, 218)
        self._space.add_grid(
            "/ground/squares",
            width=side,
            height=side,
            cell_size=edge * self._scale,
            section_size=side,
            cell_color=line,
            section_color=line,
            shadow_opacity=0.0,
            position=self._scale * middle,
        )
        corner = middle - (0.0, 0.5 * np.ptp(mesh.bounds[:, 1]) + 2.0 * edge, 0.0)
        text = f"squares of {1e3 * edge:g} mm" if edge < 1.0 else f"squares of {edge:g} m"
        self._space.add_label("/ground/edge", text, position=self._scale * corner)

    def _control(self, handle: Handle) -> viser.TransformControlsHandle:
        """Add a control that moves a handle or obstacle, or teleports a rigid body."""
        name, kind = handle.name, TeleportOrder if isinstance(handle, RigidBody) else PoseOrder

        def drag(control: viser.TransformControlsHandle) -> None:
            w, x, y, z = (float(value) for value in control.wxyz)
            moved = np.asarray(control.position) / self._scale - self._rests[name]
            self._dragged(name, kind(name, tuple(moved.tolist()), (x, y, z, w)))

        control = self._add_control(f"/handles/{name}", name, self._rests[name], drag, scale=CONTROL * self._size)
        self._space.add_label(f"/handles/{name}/label", name)
        return control

    def _goal(self, name: str, place: NDArray[np.float64]) -> viser.TransformControlsHandle:
        """Add a control at a probe; if a viewer drags the control, the actuators move the probe there."""

        def aim(control: viser.TransformControlsHandle) -> None:
            self._aimed(name, np.asarray(control.position) / self._scale)

        look = {"scale": GOAL * self._size, "disable_rotations": True, "opacity": _FAINT}
        return self._add_control(f"/probes/goals/{name}", _goal_of(name), place, aim, **look)

    def _add_control(
        self,
        path: str,
        name: str,
        place: NDArray[np.float64],
        moved: Callable[[viser.TransformControlsHandle], None],
        **look: Any,
    ) -> viser.TransformControlsHandle:
        """Add a control at a place (3,) [m]; each drag by a viewer is noted under ``name`` and passed to ``moved``."""
        where = self._scale * place
        control = self._space.add_transform_controls(
            path, disable_sliders=True, depth_test=False, position=where, **look
        )

        @control.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._touched[name] = monotonic()
            moved(event.target)

        return control

    def _follow(self, time: float, points: NDArray[np.float64]) -> None:
        """Extend the trace of each probe to its present position; if time has gone back, clear the traces first."""
        for path, point in zip(self._paths.values(), points, strict=True):
            if time < self._time:
                path.clear()
            if not path or np.abs(point - path[-1]).max() > _GRAIN * self._size:
                path.append(point)
        self._time = time

    def _draw_reactions(self, view: View) -> None:
        """Draw the force that each handle exerts on the body, as an arrow that ends at the handle's centre."""
        if self._held:
            ends = np.array([handle.centre(view.positions) for handle in self._held])
            forces = np.array([view.wrenches[handle.name][:3] for handle in self._held])
            self._arrows[REACTIONS].draw({"arrows": (self._scale * ends, forces)}, noise=self._noise(view))

    def _draw_contacts(self, view: View) -> None:
        """Draw the force on each contact point as an arrow that ends at the point, in the colour of its kind."""
        if CONTACTS in self._groups:
            points = view.contacts()
            (places, forces), slips = places_and_forces(points), points["slips"] == 1
            parts = {"sticks": ~slips, "slips": slips}
            ends = {kind: (self._scale * places[part], forces[part]) for kind, part in parts.items()}
            self._arrows[CONTACTS].draw(ends)

    def _noise(self, view: View) -> float:
        """Return the size of forces that may be an error of the solve [N]: stiffness times estimated distance."""
        error = min(self._scene.solver.tolerance, view.record.error_estimate)
        return _NOISE * self._softest * self._scene.mesh.size**2 * max(error, _ROUNDING)


def _goal_of(probe: str) -> str:
    """Return the name of a probe's control, distinct from the names of handles."""
    return f"goals/{probe}"


def _groups_of(scene: Scene) -> list[str]:
    """Return the groups of objects that a scene has."""
    there = {
        HANDLES: any(map(_is_dragged, scene.handles)),
        PROBES: scene.probes,
        REACTIONS: any(not isinstance(each, Obstacle) for each in scene.handles),
        CONTACTS: contact_names(scene.handles, scene.self_contact),
        SOLIDS: any(isinstance(each, Obstacle) and not isinstance(each, ArmLink) for each in scene.handles),
        ARMS: scene.arms,
        CHAMBERS: any(isinstance(each, Chamber) for each in scene.actuators),
        GROUND: not any(isinstance(each, Obstacle) and isinstance(each.form, Plane) for each in scene.handles),
    }
    return [name for name, wanted in there.items() if wanted]


def _is_dragged(handle: Handle) -> bool:
    return is_commanded(handle) or isinstance(handle, RigidBody)


def scale_of(mesh: HexMesh) -> float:
    """Return the factor from metres to the units of the view, in which the body's size is about 1."""
    return 10.0 ** round(-math.log10(mesh.size))


def round_length(length: float) -> float:
    """Return the largest length up to ``length`` that is 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(length))
    return next(factor * decade for factor in (5.0, 2.0, 1.0) if factor * decade <= length * (1.0 + 1e-9))


def first_view(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the camera's initial target (3,) and position (3,) in the units of the view.

    The camera sees the undeformed body, the arms, the rigid bodies, and the body moved by each pose of the program.
    """
    mesh, program = scene.mesh, scene.program
    bodily = {handle.name for handle in scene.handles if handle.section == "handles"}
    frames = program.keyframes if program is not None else {}
    moves = [key.pose.translation for name, keys in frames.items() if name in bodily for key in keys]
    places = [frame.origin for arm in scene.arms for frame in arm.rest.values()]
    places += [body.origin for body in scene.rigid_bodies]
    corners = np.vstack([mesh.bounds, *(mesh.bounds + move for move in moves), *places])
    middle, extent = 0.5 * (corners.min(axis=0) + corners.max(axis=0)), np.ptp(corners, axis=0).max()
    extent = max(extent, mesh.extent)
    return scale_of(mesh) * middle, scale_of(mesh) * (middle + extent * _EYE)


def _path(group: str) -> str:
    return f"/{group.replace(' ', '_')}"
