# SPDX-License-Identifier: Apache-2.0
"""Group 10: obstacles inside the body, through it, edge on edge, with several frictions and moduli, and at random."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import trimesh

from benchmarks.scenes import read_scene
from benchmarks.torture.bodies import Driver, distance
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh.files.stored_mesh import pack_surface
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.solver.settings import Policy

POKES, KNOCKS = 300, 30
BOUND = 1e-4
"""Largest distance from the undeformed shape after the contact has ended, divided by the body's size."""
BODY = read_scene("touched_bar.yaml")
MOTION = {"scheme": "bdf2", "step": 0.005, "damping": {"viscosity": 300.0, "mass": 20.0}}
CALM = 200
"""Number of steps after which the damped motion has ended."""
RELEASES = 6
"""Number of steps within which a body, whose last step stopped early with a message, must be undeformed again."""
DEEPEST = 1e-4
"""Largest penetration depth of a vertex after a converged step, divided by the body's size."""
_BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.02)
FORMS: dict[str, tuple[dict[str, Any], float]] = {
    "a ball": ({"sphere": {"radius": 0.02}}, 0.02),
    "a box": ({"box": {"size": [0.04, 0.03, 0.02]}}, 0.01),
    "a thin wall": ({"box": {"size": [0.2, 0.2, 0.002]}}, 0.001),
    "a capsule": ({"capsule": {"radius": 0.012, "length": 0.06}}, 0.042),
    "a cylinder": ({"cylinder": {"radius": 0.015, "length": 0.06}}, 0.03),
    "a mesh": ({"mesh": {"embedded": pack_surface(_BALL.vertices, _BALL.faces)}}, 0.02),
}
"""Dict from name to an obstacle and its extent below its centre [m]."""
HEIGHT = 0.025
"""Height of the body's upper face [m]."""
INTO = 0.004
"""Initial penetration depth of an obstacle [m]. In motion it is a quarter of this, because one time step must push the
body out."""
EDGES = {"along it": [45.0, 0.0, 0.0], "across it": [0.0, 45.0, 0.0], "a corner": [45.0, 35.264, 0.0]}
HALVES = {"the free half": {"x": [0.05, 0.1]}, "the upper half": {"z": [0.0, HEIGHT]}}
FRICTIONS = (0.0, 0.5, 10.0)
UP, DOWN, ASIDE = Pose((0.0, 0.0, 0.5)), Pose((0.0, 0.0, -0.5)), Pose((0.0, 0.5, -0.5))
PARTS = 20
"""Number of steps of one knock in motion."""


def _driver(thing: Mapping[str, Any], **more: Any) -> Driver:
    return Driver(scene_from_text(BODY, overrides={"obstacles": {"thing": dict(thing)}, **more}))


def released(driver: Driver, away: Pose = UP) -> Finding:
    """Remove the obstacle; return the distance from the undeformed shape, and deep penetrations of converged steps."""
    more = {} if driver.simulation.scene.dynamics is None else {"dt": 0.005}
    for _ in range(CALM if more else RELEASES):
        if driver.step(away, name="thing", **more).converged and not more:
            break
    mesh = driver.simulation.mesh
    error = distance(driver.results[-1].positions, mesh.vertices, mesh.size)
    said = dict.fromkeys(result.message for result in driver.results if result.message)
    settled = [result.contacts["thing"].gaps for result in driver.results if result.converged]
    depth = -min((gaps.min(initial=0.0) for gaps in settled), default=0.0) / mesh.size
    flaws = (f"settled {depth:.2g} of its size inside of the thing",) if depth > DEEPEST else ()
    return Finding(tuple(driver.results), error, driver.rise, tuple(said), flaws)


def _inside(form: dict[str, Any], reach: float, friction: float, motion: bool) -> Finding:
    """Start with an obstacle inside the body, keep it there for three steps, and remove it."""
    into, more = (0.25 * INTO, {"dynamics": MOTION}) if motion else (INTO, {})
    driver = _driver(
        {**form, "at": [0.06, 0.004, HEIGHT + reach - min(into, 0.5 * reach)], "friction": friction}, **more
    )
    for _ in range(3):
        driver.step(dt=0.005)
    first = driver.results[0]
    untouched = not motion and first.converged and not first.contacts["thing"].vertices.size
    found = released(driver)
    return replace(found, flaws=(*found.flaws, "what it began in, it does not touch")) if untouched else found


def _through(form: dict[str, Any], steps: int, friction: float) -> Finding:
    """Move an obstacle from above through the body and out below, in ``steps`` steps.

    If it still pulls a vertex along by friction, which ends there in a cone of cells, it is then moved aside.
    """
    driver = _driver({**form, "at": [0.06, 0.004, 0.06], "friction": friction})
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        driver.step(Pose((0.0, 0.0, -0.16 * share)), name="thing")
    found = released(driver, DOWN)
    return released(driver, ASIDE) if len(driver.results[-1].contacts["thing"].vertices) else found


def _edge(turn: list[float], friction: float) -> Finding:
    """Press an edge or corner of a box onto the body's upper edge, drag the box along it, and remove it."""
    thing = {"box": {"size": [0.04] * 3}, "at": [0.06, 0.025, HEIGHT + 0.03], "rotation_deg": turn}
    driver = _driver({**thing, "friction": friction})
    for way in ((0.0, 0.0, -0.01), (0.0, 0.0, -0.015), (0.01, -0.005, -0.015), (0.02, 0.005, -0.01)):
        driver.step(Pose(way), name="thing")
    return released(driver)


def _contrast(ratio: float, half: dict[str, list[float]]) -> Finding:
    """Press a ball into a body with one half that is ``ratio`` times as hard as the other half."""
    hard = {
        "materials.hard": {"law": "neo_hookean", "young": 1e5 * ratio, "poisson": 0.4, "density": 1000},
        "regions": [{"material": "soft"}, {"material": "hard", "where": {"box": half}}],
    }
    driver = _driver({"sphere": {"radius": 0.02}, "at": [0.06, 0.004, HEIGHT + 0.021], "friction": 0.5}, **hard)
    for depth in (0.004, 0.008):
        driver.step(Pose((0.0, 0.0, -depth)), name="thing")
    return released(driver)


def _poked(friction: float, pokes: int) -> Finding:
    """Place a box with random poses in and around the body, ``pokes`` times, then remove it."""
    driver = _driver({**FORMS["a box"][0], "at": [0.06, 0.0, HEIGHT + 0.1], "friction": friction})
    random = np.random.default_rng(15)
    for _ in range(pokes):
        place = random.uniform([-0.03, -0.04, -0.17], [0.07, 0.04, -0.08])
        driver.step(Pose(tuple(place), tuple(random.uniform(-2.0, 2.0, 3))), name="thing")
    return released(driver)


def _knocked(friction: float, knocks: int) -> Finding:
    """Knock on the body with a box that moves down, rotates and moves up again, with dynamics, ``knocks`` times."""
    thing = {**FORMS["a box"][0], "at": [0.06, 0.0, HEIGHT + 0.03], "friction": friction}
    driver, random = _driver(thing, dynamics=MOTION), np.random.default_rng(15)
    for _ in range(knocks):
        place, turn = random.uniform([-0.02, -0.02, -0.03], [0.03, 0.02, -0.02]), random.uniform(-0.5, 0.5, 3)
        for share in np.sin(np.linspace(0.0, np.pi, PARTS + 1)[1:]):
            driver.step(Pose(tuple(share * place), tuple(share * turn)), name="thing", dt=0.005)
    return released(driver)


def cases(pokes: int = POKES) -> list[Case]:
    """Return the cases with obstacles; there are ``pokes`` random pokes and proportionally fewer knocks in motion."""
    knocks = max(1, pokes * KNOCKS // POKES)
    case = partial(Case, group=Group.CONTACT, policy=Policy.ENERGY, law="neo-hookean", bound=BOUND)
    found = []
    for name, (form, reach) in FORMS.items():
        for motion in (False, True):
            run = partial(_inside, form, reach, 0.5, motion)
            found.append(case(name=f"{name} begins inside{', in motion' * motion}", run=run))
        for steps in (1, 12):
            run = partial(_through, form, steps, 0.0)
            found.append(case(name=f"{name} through it in {steps}", run=run, may_report=True))
    for friction in FRICTIONS:
        more = f", friction {friction:g}"
        for name, turn in EDGES.items():
            found.append(case(name=f"edge on edge, {name}{more}", run=partial(_edge, turn, friction)))
        run = partial(_through, FORMS["a ball"][0], 6, friction)
        found.append(case(name=f"through it{more}", run=run, may_report=True))
        found.append(case(name=f"{pokes} pokes{more}", run=partial(_poked, friction, pokes)))
        found.append(case(name=f"{knocks} knocks{more}", run=partial(_knocked, friction, knocks)))
    for ratio in (1e-4, 1e4):
        for name, half in HALVES.items():
            found.append(case(name=f"{name} {ratio:g} times as hard", run=partial(_contrast, ratio, half)))
    return found
