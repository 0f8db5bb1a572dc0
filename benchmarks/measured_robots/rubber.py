# SPDX-License-Identifier: Apache-2.0
"""Rubbers in three modes: each law fitted in tension, and its prediction of equibiaxial tension and pure shear.

``python -m benchmarks.measured_robots.rubber`` prints the table of docs/measured_rubber.md (a minute). A file
``meunier2008_equibiaxial.csv`` or ``meunier2008_pure_shear.csv`` in the folder after ``--data`` is compared, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.curves import POINTS, Curve, draw_panels
from benchmarks.markdown import markdown_table
from benchmarks.measured_robots import ROBOTS
from benchmarks.report import run_script
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.laws.tensile import fit_tensile
from gdfe_ros.materials import Law, Material
from gdfe_ros.mesh import bar
from gdfe_ros.results.element_fields import corner_forces, volume_pressures
from gdfe_ros.solver.body import Body

Array = NDArray[np.float64]
LAWS = (Law.NEO_HOOKEAN, Law.MOONEY_RIVLIN, Law.YEOH, Law.ARRUDA_BOYCE, Law.GENT, Law.OGDEN, Law.CURVE)
MODES = {
    "uniaxial": lambda s: (s, s**-0.5, s**-0.5),
    "equibiaxial": lambda s: (s, s, s**-2.0),
    "pure_shear": lambda s: (s, 1.0, 1.0 / s),
}
"""Dict from mode to the principal stretches at constant volume; the last direction is free of stress."""
RUBBERS = {"Treloar 1944": "treloar1944", "Kawabata 1981": "kawabata1981", "Meunier 2008": "meunier2008"}
FITTED = {"Treloar 1944": (2.0, 7.61), "Kawabata 1981": (2.2,), "Meunier 2008": (2.17,)}
"""Dict from rubber to the largest stretches of the tension tests to which the laws are fitted."""
LEAST = 0.05
"""Points with a smaller strain are not compared: their reading is too uncertain."""
SIDE = 0.01


def read_modes(folder: Path, rubber: str) -> dict[str, tuple[Array, Array]]:
    """Return dict from mode to stretches (k,) and nominal stresses (k,) [Pa] of a rubber, ascending.

    ``compression`` is the part of the tension test below stretch 1; modes without a file are left out.
    """
    stem, found = RUBBERS[rubber], {}
    if (whole := folder / f"{stem}.csv").is_file():
        rows = np.genfromtxt(whole, delimiter=",", names=True, dtype=None, encoding="utf-8")
        rows = rows[rows["reading"] == "table"]
        for mode in MODES:
            own = rows[rows["mode"] == mode]
            found[mode] = own["stretch"], own["nominal_stress_Pa"].astype(float)
    else:
        for mode in MODES:
            if (path := folder / f"{stem}_{mode}.csv").is_file():
                rows = np.genfromtxt(path, delimiter=",", names=True)
                found[mode] = rows["stretch"], rows["nominal_stress_Pa"]
    if "uniaxial" in found:
        stretch, stress = found["uniaxial"]
        found["uniaxial"] = stretch[stretch >= 1.0], stress[stretch >= 1.0]
        if (stretch < 1.0).any():
            found["compression"] = stretch[stretch < 1.0], stress[stretch < 1.0]
    return found


def nominal_stress(material: Material, mode: str, stretches: Array) -> Array:
    """Return the nominal stresses (k,) [Pa] along the first axis at constant volume, of one cube of the solver.

    P = P_11 - P_33 l_3 / l_1, where the pressure that P_33 shows is removed.
    """
    mesh = bar([SIDE] * 3, [1, 1, 1])
    body = Body.build(mesh.vertices, mesh.cells, [material], np.zeros(1, np.int32), ())
    order, found = np.argsort(body.cells[0]), []
    for stretch in stretches:
        gradient = np.array(MODES["uniaxial" if mode == "compression" else mode](float(stretch)))
        place = np.ascontiguousarray(body.rest * gradient)
        forces = corner_forces(body, place, volume_pressures(body, place))[0][0][order]
        far = body.rest > body.rest.mean(axis=0)
        stress = np.array([forces[far[:, axis], axis].sum() for axis in range(3)]) / SIDE**2
        found.append(stress[0] - stress[2] * gradient[2] / gradient[0])
    return np.array(found)


def largest_invariant(mode: str, stretches: Array) -> Array:
    """Return I1 (k,) at stretches of a mode."""
    kind = MODES["uniaxial" if mode == "compression" else mode]
    return np.array([float(np.sum(np.square(kind(float(stretch))))) for stretch in stretches])


def measure_rubbers(
    folder: Path, *, fitted: Mapping[str, Sequence[float]] = FITTED, laws: Sequence[Law] = LAWS
) -> list[dict[str, Any]]:
    """Return a dict for each rubber, range and law: its parameters, and the misfit of each mode.

    Modes are compared up to the largest I1 of the fitted test: beyond it, every law is an extrapolation.
    """
    report = []
    for rubber, ends in fitted.items():
        modes = read_modes(ROBOTS, rubber) | read_modes(folder, rubber)
        stretch, stress = modes["uniaxial"]
        for end in ends:
            used = (stretch > 1.0) & (stretch <= end)
            most = largest_invariant("uniaxial", stretch[used]).max()
            for law in laws:
                row = {"rubber": rubber, "end": end, "law": law.name.lower(), "modes": {}}
                try:
                    fit = fit_tensile(stretch[used] - 1.0, stress[used], law=law, slack=0.0)
                except GdfeError as error:
                    report.append(row | {"refused": str(error)})
                    continue
                row |= {"entry": dict(fit.entry), "shear": fit.material.shear0}
                row["modes"] = {m: _compare(fit.material, m, *test, most) for m, test in modes.items()}
                report.append(row)
    return report


def _compare(material: Material, mode: str, stretch: Array, stress: Array, most: float) -> dict[str, Any]:
    """Return stretches, recorded and predicted stresses of the compared points, and the rms of the relative errors."""
    used = (np.abs(stretch - 1.0) >= LEAST) & (largest_invariant(mode, stretch) <= 1.001 * most)
    predicted = nominal_stress(material, mode, stretch[used])
    error = predicted / stress[used] - 1.0
    points = {"stretch": stretch[used].tolist(), "recorded": stress[used].tolist(), "predicted": predicted.tolist()}
    return points | {"rms": float(np.sqrt(np.mean(error**2))), "mean": float(np.mean(error))}


def rubber_table(report: list[Mapping[str, Any]]) -> str:
    """Return the table: a row for each rubber, range and law."""
    names = list(dict.fromkeys(mode for row in report for mode in row["modes"]))
    rows = []
    for row in report:
        modulus = f"{1e-6 * row['shear']:.3f}" if "shear" in row else "refused"
        cells = [row["rubber"], f"{row['end']:g}", f"`{row['law']}`", modulus]
        rows.append([*cells, *(_cell(row["modes"].get(name)) for name in names)])
    head = ("rubber", "fitted to stretch", "law", "shear modulus [MPa]")
    return markdown_table((*head, *(f"{name.replace('_', ' ')}: rms (mean)" for name in names)), rows)


def _cell(mode: Mapping[str, Any] | None) -> str:
    if mode is None:
        return ""
    if mode["rms"] > 10.0:
        return f"factor {mode['rms']:.0f}"
    return f"{100.0 * mode['rms']:.1f} % ({100.0 * mode['mean']:+.1f} %)"


def draw_rubbers(folder: Path, report: list[Mapping[str, Any]]) -> None:
    """Draw recorded and predicted stresses of Treloar's rubber, fitted to stretch 2 and to its end."""
    panels: dict[str, list[Curve]] = {}
    for row in (row for row in report if row["rubber"] == "Treloar 1944" and row["modes"]):
        for mode in MODES:
            points = row["modes"][mode]
            told, found = 1e-6 * np.array(points["recorded"]), 1e-6 * np.array(points["predicted"])
            curves = panels.setdefault(f"{mode.replace('_', ' ')}; fitted in tension to {row['end']:g}", [])
            curves[:1] = [(points["stretch"], told, {**POINTS, "color": "k"})]
            shown = np.where(found < 2.0 * told.max(), found, np.nan)
            curves.append((points["stretch"], shown, {"lw": 1.1, "label": row["law"]}))
    labels = {"x": "stretch", "y": "nominal stress [MPa]; points: recorded"}
    draw_panels(folder / "measured_rubber.png", panels, **labels, columns=3)


def probe() -> dict[str, float]:
    """Return the misfit of equibiaxial tension by the laws of neo-Hooke and Yeoh, fitted in tension to stretch 2."""
    rows = measure_rubbers(ROBOTS, fitted={"Treloar 1944": (2.0,)}, laws=(Law.NEO_HOOKEAN, Law.YEOH))
    return {f"equibiaxial, {row['law']}, fitted to 2": row["modes"]["equibiaxial"]["rms"] for row in rows}


if __name__ == "__main__":
    run_script(
        "benchmarks.measured_robots.rubber",
        "Rubbers in three modes.",
        "measured_rubber",
        measure=measure_rubbers,
        tables=rubber_table,
        probe=probe,
        draw=draw_rubbers,
        data=ROBOTS,
    )
