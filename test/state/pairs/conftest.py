# SPDX-License-Identifier: Apache-2.0
"""Features: small bodies with their load paths, and comparisons of states to the last bit."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from dataclasses import fields as fields_of
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from test.written import STRIP, scene_of

BAR = """\
mesh: {{bar: {{size: [0.1, 0.02, 0.02], cells: [4, 2, 2]}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e6, poisson: 0.45, density: 1000}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}, {handles}}}
actuators: {{{actuators}}}
probes: {{edge: [0.05, 0, 0.01]}}
solver: {{tolerance: 1.0e-5}}
{more}
"""
BALL = """\
mesh: {{sphere: {{inner: 0.010, outer: 0.015, cells: [2, 1]}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e6, poisson: {poisson}}}}}
handles: {{base: {{where: {{box: {{x: [-1, -0.0101]}}}}, fixed: true}}}}
actuators: {{air: {{chamber: {{command: {mode}, range: {limits}}}}}}}
probes: {{edge: [0.0149, 0, 0]}}
solver: {{tolerance: 1.0e-5}}
"""
CAVITY = 8e-6
"""Volume of the strip's undeformed chamber [m^3]."""
TIP = "tip: {where: {face: x+}}"
STRING = "pull: {{cable: {{points: [[0.025, 0, 0.008], [0.1, 0, 0.008]], range: {limits}, command: {mode}}}}}"
PULL = STRING.format(mode="tension", limits=[0, 1e5])
HEAT = "heat: {growth: {stretch: [0.9, 1, 1], where: {box: {z: [0, 1]}}}}"
LOADS = "loads: {weight: {gravity: [0, 0, -9.81]}, push: {point: {at: [0.1, 0.003, 0.01], force: [0, 0.2, 0.1]}}}"
LIFT, OVER = Pose((-0.002, 0.004, 0.02), (0.2, 0.1, 0.0)), Pose((-0.3, 0.0, 0.0))
VOLUME = 3.4e-6
"""Volume of the ball's undeformed chamber, about [m^3]."""
NUMBERS = ("time", "converged", "iterations", "error_estimate", "energy", "min_det", "skipped", "substeps", "restarts")
WORDS = ("message", "cut_after", "actuators", "policy", "energies")
Way = list[tuple[Command, dict]]


class Differences:
    """Comparisons to the last bit; each returns the names of all that differs."""

    def result(self, found: StepResult, expected: StepResult) -> list[str]:
        """Compare two results except for the wall time; return the differing names."""
        names = [name for name in NUMBERS + WORDS if getattr(found, name) != getattr(expected, name)]
        names += [name for name, loads in expected.reactions.items() if not _equal(found.reactions[name], loads)]
        names += [] if np.array_equal(found.velocities, expected.velocities) else ["velocities"]
        return names if _equal(found.positions, expected.positions) else ["positions", *names]

    def run(self, found: list[StepResult], expected: list[StepResult]) -> list[str]:
        """Compare results step by step; return the differing names."""
        pairs = enumerate(zip(found, expected, strict=True))
        return [f"{name} of step {number}" for number, pair in pairs for name in self.result(*pair)]

    def fields(self, found: Any, expected: Any) -> list[str]:
        """Compare element fields; return the differing names."""
        names = [item.name for item in fields_of(expected)]
        return [name for name in names if not _equal(getattr(found, name), getattr(expected, name))]

    def state(self, one: Simulation, other: Simulation) -> list[str]:
        """Compare the public states of two simulations; return the differing names."""
        first, second = (
            {
                "time": each.time,
                "targets": each.targets,
                "commands": each.commands,
                "actuators": each.actuator_states(),
                "poses": [each.handle_pose(name) for name in each.handle_names],
            }
            for each in (one, other)
        )
        names = [name for name in first if first[name] != second[name]] + self.fields(one.fields(), other.fields())
        return names if _equal(one.positions, other.positions) else ["positions", *names]


def _equal(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return np.array_equal(one, other, equal_nan=True)


@dataclass
class Feature:
    """A body and its load path.

    Attributes:
        scene: the body of all simulations.
        end: last command of the path, complete.
        away: last command of another path.
        absurd: a command within all ranges that has no equilibrium, or hardly one.
        lever: an actuator and a small change of its command, for derivatives.
        start: dict from actuator name to initial command, where it is not zero.
        parts: number of steps into which the path to ``end`` is divided.
        cuts: ``cut_after`` of the steps, repeated cyclically.
        seen: function from the results to whether the feature was active.
    """

    scene: Scene
    end: Command
    away: Command
    absurd: Command
    lever: tuple[str, float]
    start: dict[str, float] = field(default_factory=dict)
    parts: int = 3
    cuts: tuple[int | None, ...] = (None,)
    seen: Callable[[list[StepResult]], bool] = field(default=lambda results: True)

    @property
    def way(self) -> Way:
        """Commands and options of the steps to ``end``; the last step is not cut."""
        steps = [self._part(self.end, part / self.parts) for part in range(1, self.parts + 1)]
        cuts = [self.cuts[index % len(self.cuts)] for index in range(self.parts)]
        return [(step, {"dt": 0.1, "cut_after": cut}) for step, cut in zip(steps, cuts, strict=True)] + [(self.end, {})]

    @property
    def elsewhere(self) -> Way:
        """Commands and options of the steps to ``away``."""
        return [(self._part(self.away, part), {"dt": 0.3}) for part in (0.5, 1.0)]

    @cached_property
    def results(self) -> list[StepResult]:
        """Results of the path in a simulation of its own."""
        return self.run(self.simulation(), self.way)

    def simulation(self) -> Simulation:
        """Make a simulation of the scene."""
        return Simulation(self.scene)

    def run(self, simulation: Simulation, way: Way) -> list[StepResult]:
        """Make these steps; return their results."""
        return [simulation.step(command, **how) for command, how in way]

    def finish(self, simulation: Simulation) -> StepResult:
        """Repeat the last command until its step converges; return the result."""
        for _ in range(20):
            result = simulation.step(self.end)
            if result.converged:
                break
        assert result.converged, result.message
        return result

    def _part(self, command: Command, part: float) -> Command:
        begin = {name: self.start.get(name, 0.0) for name in command.actuators}
        return Command(
            {name: Pose().blend(pose, part) for name, pose in command.handles.items()},
            {name: begin[name] + part * (value - begin[name]) for name, value in command.actuators.items()},
            {name: part * value for name, value in command.loads.items()},
        )


def bar(handles: str = "", actuators: str = PULL, more: str = "", **keys: object) -> Scene:
    """Make a scene of the bar; keywords override scene keys, double underscores stand for dots."""
    text = BAR.format(handles=handles, actuators=actuators, more=more)
    return scene_of(text, overrides={key.replace("__", "."): value for key, value in keys.items()})


def driven(scene: Scene, end: dict, away: dict, absurd: dict, lever: tuple[str, float], **how: Any) -> Feature:
    """Make a feature of a body that is driven by actuators only."""
    return Feature(scene, *(Command(actuators=values) for values in (end, away, absurd)), lever, **how)


def grown(**keys: object) -> Feature:
    """Make a feature of the bar that bends by growth and by a cable."""
    ways = {"heat": 0.5, "pull": 0.2}, {"heat": 1.0, "pull": 0.0}, {"heat": 1.0, "pull": 1e4}
    return driven(bar(actuators=f"{HEAT}, {PULL}", **keys), *ways, ("heat", 1e-3))


def relative() -> Feature:
    """Make a feature of the bar that grows under the policy ``relative``."""
    scene = bar(actuators=HEAT, solver__policy="relative")
    return driven(scene, {"heat": 0.3}, {"heat": 1.0}, {"heat": 0.0}, ("heat", 1e-2))


def shortened(mode: str, rest: float, sign: float, **keys: object) -> Feature:
    """Make a feature of the bar bent by a cable of commanded length or shortening."""
    string = STRING.format(mode=mode, limits=[0.001 if rest else -0.05, 0.2])
    ways = [{"pull": rest + sign * change} for change in (0.003, 0.006, 0.05)]
    return driven(bar(actuators=string, **keys), *ways, ("pull", 1e-5), start={"pull": rest})


def blown(mode: str, end: float, away: float, absurd: float, rest: float = 0.0, **how: Any) -> Feature:
    """Make a feature of the ball with a commanded chamber."""
    limits = [-1e5, 1e7] if mode == "pressure" else [1e-9, 1e-3]
    scene = scene_of(BALL.format(mode=mode, limits=limits, poisson=how.pop("poisson", 0.45)))
    ways = [{"air": value} for value in (end, away, absurd)]
    return driven(scene, *ways, ("air", 1e-3 * (end - rest)), start={"air": rest}, **how)


def moved(free: str = "", pose: Pose = LIFT, *, heat: float = 0.0, loads: float = 0.0, **keys: Any) -> Feature:
    """Make a feature of the bar whose tip is moved by its handle while a cable pulls it a little."""
    options = {name: keys.pop(name) for name in ("parts", "cuts", "seen") if name in keys}
    given = {"handles": f"{keys.pop('wall', '')}{TIP[:-1]}, free: [{free}]}}", "more": LOADS if loads else ""}
    factors, growth = ({"weight": loads, "push": loads} if loads else {}), ({"heat": heat} if heat else {})
    scene = bar(actuators=f"{HEAT}, {PULL}" if heat else PULL, **given, **keys)
    end = Command({"tip": pose}, {"pull": 0.2, **growth}, factors)
    away = Command({"tip": Pose((0.001, -0.01, -0.01))}, {"pull": 0.0}, {name: -0.5 for name in factors})
    return Feature(scene, end, away, Command({"tip": OVER}, {"pull": 0.0}), ("pull", 0.05), **options)


def pressed(name: str, end: Pose, **keys: Any) -> Feature:
    """Make a feature of the bar whose handle or obstacle ``name`` presses and rubs while a cable pulls it a little."""
    ends = [Command({name: pose}, {"pull": 0.02}) for pose in (end, Pose((0.001, 0.0, -0.002)), OVER)]
    options = {key: keys.pop(key) for key in ("parts", "cuts") if key in keys}
    return Feature(bar(**keys), *ends, ("pull", 0.05), seen=rubs, **{"parts": 4, **options})


def rubs(results: list[StepResult]) -> bool:
    """Return whether points press and slip in the first half of the steps."""
    touches = [touch for result in results[: len(results) // 2] for touch in result.contacts.values()]
    return any(touch.presses.max(initial=0.0) > 0.01 and touch.slips.any() for touch in touches)


def strip() -> Feature:
    """Make a feature of a strip with a cavity, too large for the explicit inverse, with springs in its tangent."""
    ways = {"wire": 1e-3, "air": 1.1 * CAVITY}, {"wire": 0.0, "air": 1.3 * CAVITY}, {"wire": 0.02, "air": CAVITY}
    return driven(scene_of(STRIP), *ways, ("wire", 1e-5), start={"air": CAVITY})


def cut(results: list[StepResult]) -> bool:
    """Return whether a step was cut."""
    return any(result.cut_after is not None and not result.converged for result in results)


FAR = {
    "mesh": "{grid: {x: [50.0, 50.025, 50.05, 50.075, 50.1], y: [-0.01, 0, 0.01], z: [-0.01, 0, 0.01]}}",
    "actuators__pull__cable__points": [[50.025, 0, 0.008], [50.1, 0, 0.008]],
    "probes__edge": [50.05, 0, 0.01],
}
SHARED = {"mesh": "{bar: {size: [0.1, 0.02, 0.02], cells: [30, 4, 4]}}", "solver__threads": 2}
CURVE = "{law: curve, strain: [0.1, 0.4, 1.0, 2.0], stress: [1.0e5, 3.0e5, 6.0e5, 11.0e5], poisson: 0.45}"
STIFF = {"actuators__pull__cable__stiffness": 500.0}
FEATURES: dict[str, Callable[[], Feature]] = {
    **{f"growth-{nu}": lambda nu=nu: grown(materials__rubber__poisson=nu) for nu in (0.45, 0.499, 0.5)},
    "tension": lambda: driven(bar(), {"pull": 0.4}, {"pull": 1.0}, {"pull": 1e4}, ("pull", 0.02)),
    "length": lambda: shortened("length", 0.075, -1.0),
    "shortening": lambda: shortened("shortening", 0.0, 1.0),
    "elastic": lambda: shortened("shortening", 0.0, 1.0, **STIFF),
    "pressure": lambda: blown("pressure", 8e4, 1.2e5, 1e6),
    "pressure-0.5": lambda: blown("pressure", 8e4, 1.2e5, 1e6, poisson=0.5),
    "volume": lambda: blown("volume", 1.5 * VOLUME, 2.5 * VOLUME, 100 * VOLUME, VOLUME),
    "volume-0.5": lambda: blown("volume", 1.5 * VOLUME, 2.5 * VOLUME, 100 * VOLUME, VOLUME, poisson=0.5),
    "loads": lambda: moved("x, y, z", Pose(), loads=1.0),
    "sliding": lambda: moved("x"),
    "turning": lambda: moved("ry", Pose((-0.002, 0.0, 0.01))),
    "turning-two": lambda: moved("rx, ry", Pose((-0.002, 0.004, 0.01), (0.0, 0.0, 0.2))),
    "turning-three": lambda: moved("rx, ry, rz", Pose((-0.002, 0.004, 0.01))),
    "loose": lambda: moved("x, y, z, rx, ry, rz", Pose(), loads=1.0),
    **{f"nu-{nu}": lambda nu=nu: moved(materials__rubber__poisson=nu) for nu in (0.0, 0.495, 0.5)},
    "linear": lambda: moved(materials__rubber__law="linear"),
    "linear-0.495": lambda: moved(materials__rubber="{law: linear, young: 1.0e6, poisson: 0.495}"),
    "ogden": lambda: moved(materials__rubber="{preset: ninjaflex, law: ogden, poisson: 0.45}"),
    "curve": lambda: moved(materials__rubber=CURVE),
    "far": lambda: moved(**FAR),
    "cut": lambda: moved(cuts=(3, 0, 6), parts=6, seen=cut),
    "cut-ball": lambda: blown("pressure", 8e4, 1.2e5, 1e6, cuts=(4, 1, 9), parts=6, seen=cut),
    "relative": relative,
    "all": lambda: moved("x, ry", Pose((0.0, 0.0, 0.01)), heat=0.4, loads=1.0, materials__rubber__poisson=0.495),
}
MOVES = {"dynamics": {"step": 0.02, "scheme": "bdf2", "prony": [{"share": 0.2, "time": 0.01}]}}
PIN = {"obstacles": {"pin": {"sphere": {"radius": 0.0075}, "at": [0.05, 0.0, -0.0176], "friction": 0.4}}}
PLANES = {"x": [0.0, 0.025, 0.05, 0.0502, 0.075, 0.1], "y": [-0.01, 0.0, 0.01], "z": [-0.01, 0.0, 0.01]}
BLOCKS: dict[str, Any] = {
    "mesh": {"grid": {**PLANES, "cut": [{"box": {"x": [0.05, 0.0502]}}]}},
    "handles": TIP,
    "self_contact": {"friction": 0.3},
}
UP, ALONG = Pose((0.004, 0.0, 0.006)), Pose((-0.0015, 0.0, 0.008))
HISTORIES: dict[str, Callable[[], Feature]] = {
    "springs": strip,
    "swing": lambda: driven(bar(**MOVES), {"pull": 0.4}, {"pull": 1.0}, {"pull": 1e4}, ("pull", 0.02)),
    "swing-cut": lambda: moved(cuts=(3, 0, 6), parts=6, seen=cut, **MOVES),
    "contact": lambda: pressed("pin", UP, **PIN),
    "contact-moves": lambda: pressed("pin", UP, **PIN, **MOVES),
    "self-contact": lambda: pressed("tip", ALONG, **BLOCKS),
    "self-contact-cut": lambda: pressed("tip", ALONG, parts=6, cuts=(None, 0, 1), **BLOCKS),
    "self-contact-moves": lambda: pressed("tip", ALONG, **BLOCKS, **MOVES),
}
"""Features whose states depend on their paths: other paths do not lead to the same equilibrium."""
if "PAIRS_IN_THREADS" in os.environ:
    HISTORIES = {}
    FEATURES = {"threads": lambda: moved(parts=2, **SHARED)}


@pytest.fixture(scope="session", params=FEATURES)
def feature(request: pytest.FixtureRequest) -> Feature:
    """Give each feature in turn."""
    return FEATURES[request.param]()


@pytest.fixture(scope="session")
def differences() -> Differences:
    """Give comparisons to the last bit."""
    return Differences()
