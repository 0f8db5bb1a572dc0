# SPDX-License-Identifier: Apache-2.0
"""A soft robot's material in an afternoon: a form with five measurements becomes a fitted scene with its error.

``python -m benchmarks.measured_robots.afternoon [FORM.yaml] [--scene FILE]`` fits the modulus to the sag and the
viscosity to the decay, writes the scene, and prints what it says about all five measurements (docs/afternoon.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import newton

from benchmarks.beam import swings
from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from gdfe_ros import Simulation
from gdfe_ros.scene import scene_from_text

FORM = Path(__file__).with_name("afternoon.yaml")
NUMBERS = ("length", "width", "height", "mass", "sag", "frequency", "damping_ratio")
GRAVITY, POISSON = 9.81, 0.49
STEPS = 30
"""Time steps in a period of the swing."""
PERIODS = 16
"""Duration of the simulated swing, in periods."""


def read_form(path: Path) -> dict[str, Any]:
    """Return a form.

    Raises:
        ValueError: a number is missing, or not a positive number.
    """
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(form, dict):
        raise ValueError(f"{path} is not a form: it has no keys; remedy: copy {FORM}")
    load = form.get("load") or {}
    given = {name: form.get(name) for name in NUMBERS} | {f"load.{name}": load.get(name) for name in ("mass", "sag")}
    wrong = [
        f"{name} = {value!r}; allowed: a number above 0, in SI units"
        for name, value in given.items()
        if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 < value < np.inf
    ]
    if wrong:
        raise ValueError(f"{path}: {'; '.join(wrong)}; remedy: measure and fill in, as in {FORM}")
    return form


def strip(form: dict[str, Any], young: float, *, viscosity: float = 0.0, load: float = 0.0) -> dict[str, Any]:
    """Return the scene of the strip with a modulus [Pa]; with a viscosity [Pa s], it moves."""
    size = [form[name] for name in ("length", "width", "height")]
    cell = min(size) / 4.0
    data = {
        "name": form.get("name", "afternoon"),
        "mesh": {"bar": {"size": size, "cells": [max(2, round(side / cell)) for side in size]}},
        "materials": {
            "own": {
                "law": "neo_hookean",
                "young": float(young),
                "poisson": POISSON,
                "density": form["mass"] / float(np.prod(size)),
            }
        },
        "regions": [{"material": "own"}],
        "handles": {"base": {"where": {"face": "x-"}, "fixed": True}},
        "loads": {"weight": {"gravity": [0.0, 0.0, -GRAVITY]}},
        "probes": {"end": [size[0], 0.0, 0.0]},
    }
    if load:
        data["masses"] = {"load": {"mass": load, "where": {"face": "x+"}}}
    if viscosity:
        period = 1.0 / form["frequency"]
        data["dynamics"] = {"step": period / STEPS, "damping": {"viscosity": float(viscosity)}}
    return data


def sag(data: dict[str, Any]) -> float:
    """Return the sag [m] of the end at equilibrium."""
    simulation = Simulation(scene_from_text(yaml.safe_dump(data), origin="of the form"))
    result = simulation.step()
    if not result.converged:
        raise RuntimeError(f"the strip has no equilibrium: {result.message}; remedy: check sag and mass")
    return -float(simulation.probe_positions()["end"][2])


def swing(data: dict[str, Any], frequency: float) -> tuple[float, float, float]:
    """Return sag [mm], frequency [Hz] and damping ratio of the strip that is released straight."""
    simulation = Simulation(scene_from_text(yaml.safe_dump(data), origin="of the form"))
    found: list[tuple[float, float]] = []
    while simulation.time < PERIODS / frequency:
        result = simulation.step()
        found.append((result.time, 1e3 * float(simulation.probe_positions()["end"][2])))
    times, heights = np.array(found).T
    return swings(times, heights)


def fit_young(form: dict[str, Any]) -> float:
    """Return the modulus [Pa] with which the strip sags as the form says, by a secant search from thin-beam theory."""
    start = _theory(form)
    return float(newton(lambda value: sag(strip(form, value)) / form["sag"] - 1.0, start, x1=1.1 * start, rtol=1e-3))


def identify(form: dict[str, Any]) -> tuple[dict[str, Any], list[tuple[str, float, float, str]]]:
    """Return the fitted scene, and a row for each measurement: name, measured, simulated value, and its use."""
    young = fit_young(form)
    viscosity = form["damping_ratio"] * young / (np.pi * form["frequency"])
    ratio = swing(strip(form, young, viscosity=viscosity), form["frequency"])[2]
    viscosity *= form["damping_ratio"] / ratio
    scene = strip(form, young, viscosity=viscosity)
    _, frequency, ratio = swing(scene, form["frequency"])
    loaded = sag(strip(form, young, load=form["load"]["mass"]))
    density = scene["materials"]["own"]["density"]
    rows = [
        ("mass [kg]", form["mass"], density * form["length"] * form["width"] * form["height"], "gives the density"),
        ("sag [m]", form["sag"], sag(strip(form, young)), "gives the modulus"),
        ("damping ratio", form["damping_ratio"], ratio, "gives the viscosity"),
        ("frequency [Hz]", form["frequency"], frequency, "predicted"),
        ("sag with the load [m]", form["load"]["sag"], loaded, "predicted"),
    ]
    return scene, rows


def form_table(report: Mapping[str, Any]) -> str:
    """Return the table of measured and simulated values, after a line with the fitted material."""
    scene, rows = report["scene"], report["rows"]
    own, viscosity = scene["materials"]["own"], scene["dynamics"]["damping"]["viscosity"]
    line = f"E = {1e-3 * own['young']:.0f} kPa, density {own['density']:.0f} kg/m^3, viscosity {viscosity:.0f} Pa s"
    cells = [[n, f"{a:.4g}", f"{b:.4g}", f"{100.0 * (b / a - 1.0):+.1f} %", use] for n, a, b, use in rows]
    return f"{line}\n\n{markdown_table(('measurement', 'measured', 'scene', 'error', 'use'), cells)}"


def probe() -> dict[str, float]:
    """Return the modulus [Pa] that fits the sag of the shipped form."""
    return {"young [Pa]": fit_young(read_form(FORM))}


def main() -> int:
    """Fit a form, write its scene and the report, and print the table."""
    parser = options("benchmarks.measured_robots.afternoon", "A form becomes a fitted scene.", "afternoon")
    parser.add_argument("form", nargs="?", type=Path, default=FORM, help="the form; default: that of the recorded beam")
    parser.add_argument("--scene", type=Path, default=Path("runs", "afternoon.yaml"), help="file of the fitted scene")
    given = parser.parse_args()
    scene, rows = identify(read_form(given.form))
    report = {"scene": scene, "rows": rows}
    write_report(given.out, report, probe())
    given.scene.parent.mkdir(parents=True, exist_ok=True)
    given.scene.write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    print(f"{form_table(report)}\n\nwritten: {given.scene}")
    return 0


def _theory(form: dict[str, Any]) -> float:
    """Return the modulus [Pa] of a thin beam with this sag: the start of the search."""
    line = form["mass"] * GRAVITY / form["length"]
    inertia = form["width"] * form["height"] ** 3 / 12.0
    return float(line * form["length"] ** 4 / (8.0 * inertia * form["sag"]))


if __name__ == "__main__":
    raise SystemExit(main())
