# SPDX-License-Identifier: Apache-2.0
"""Results of a fit to a tensile test: as rows of text, as an entry of a scene, as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import yaml
from matplotlib.figure import Figure

from gdfe_ros.fitting.tensile import TensileFit

_PLAIN = ("linear", "neo_hookean", "stable_neo_hookean", "curve")
"""Laws whose stability needs no check of several deformations."""
ACCEPTABLE = 0.05
"""Relative misfit above which another law is recommended; repeated tests of one batch differ by about this much."""


def tensile_rows(fit: TensileFit) -> list[tuple[str, str]]:
    """Return the results as pairs of name and text."""
    parameters = {key: value for key, value in fit.entry.items() if key not in ("law", "poisson", "density")}
    rows = [("law", str(fit.entry["law"]))]
    for name, value in parameters.items():
        values = value if isinstance(value, list) else [value]
        rows.append((name, "  ".join(f"{number:.7g}" for number in values)))
    return [
        *rows,
        ("initial modulus [Pa]", f"{fit.material.young0:.5g}"),
        ("misfit, root mean square", f"{100.0 * float(np.sqrt(np.mean(fit.misfit**2))):.3g} % of the stress"),
        ("misfit, largest", f"{100.0 * fit.largest:.3g} % at strain {fit.strain[np.abs(fit.misfit).argmax()]:g}"),
        ("valid", f"strain {min(0.0, fit.strain.min()):g} to {max(0.0, fit.strain.max()):g}, of tension alone"),
        (
            "stability",
            "stable" if fit.entry["law"] in _PLAIN else "stable in uniaxial, equibiaxial and planar deformation",
        ),
    ]


def tensile_remarks(fit: TensileFit) -> list[str]:
    """Return remarks on points left out, on refused laws and on a large misfit; empty if there are none."""
    notes = [*fit.notes, *fit.refused]
    if fit.largest > ACCEPTABLE:
        text = f"no stable law of this kind has a largest misfit below {100.0 * fit.largest:.2g} %"
        notes.append(f"{text}; remedy: law: curve with the measured table (csv), which passes through every point")
    return notes


def material_text(fit: TensileFit, name: str) -> str:
    """Return the fitted law as YAML text for the key `materials` of a scene."""
    return yaml.safe_dump({name: dict(fit.entry)}, sort_keys=False, default_flow_style=None, width=110)


def draw_tensile(path: Path, fit: TensileFit, *, title: str) -> None:
    """Draw the test and the law: nominal stress over strain, and the misfit of each point.

    Raises:
        OSError: the picture cannot be written.
    """
    figure = Figure(figsize=(9.0, 4.2), dpi=130, layout="constrained")
    curve, misfit = figure.subplots(1, 2, width_ratios=(3, 2))
    low, high = min(0.0, float(fit.strain.min())), max(0.0, float(fit.strain.max()))
    grid = np.linspace(low, high, 400)
    curve.plot(fit.strain, 1e-3 * fit.stress, "o", ms=4, color="#6b6f76", label="measured")
    curve.plot(grid, 1e-3 * fit.material.stress_at(grid), color="#1b6ca8", label=str(fit.entry["law"]))
    curve.set_xlabel("engineering strain")
    curve.set_ylabel("nominal stress [kPa]")
    curve.legend(frameon=False)
    misfit.axhline(0.0, color="0.7", lw=0.8)
    misfit.plot(fit.strain, 100.0 * fit.misfit, "o-", ms=4, lw=0.8, color="#c2562d")
    misfit.set_xlabel("engineering strain")
    misfit.set_ylabel("misfit [% of the stress]")
    for axes in (curve, misfit):
        axes.grid(color="0.93")
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)
