# SPDX-License-Identifier: Apache-2.0
"""A membrane of Ecoflex 00-30 that lifts a weight: pressure against height, with the published law, nothing fitted.

``python -m benchmarks.measured_robots.membrane`` prints the table of docs/measured_membrane.md (three minutes).
``--data FILE`` compares with another file of the same columns, for example with recordings that were kept apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.curves import POINTS, Curve, draw_panels
from benchmarks.markdown import markdown_table
from benchmarks.measured_robots import ROBOTS
from benchmarks.measured_robots.membrane_body import Design, lift
from benchmarks.report import run_script

Array = NDArray[np.float64]
MEASURED = ROBOTS / "membrane_lift.csv"
GOAL = 0.06
"""Goal of the comparison: largest relative difference of the pressures at equal height."""
SPREAD = 0.06
"""Heights are left out if the recorded pressures spread by more than this from the tenth to the ninetieth percentile:
there the cap sets down, or the membrane runs away."""


def recorded(path: Path = MEASURED) -> Iterator[tuple[Design, float, Array, Array, Array]]:
    """Yield design, weight [N], heights (k,) [m], median pressures [Pa] (k,) and spreads (k,) of each recording."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    sizes = [name for name in rows.dtype.names if name.endswith("_m") and name != "height_m"]
    keys = np.nan_to_num(np.array([rows[name] for name in (*sizes, "lifted_weight_N")]).T)
    for key in np.unique(keys, axis=0):
        own = rows[(keys == key).all(axis=1)]
        own = own[np.argsort(own["height_m"])]
        rings = tuple((float(key[k]), float(key[k + 1])) for k in (2, 4) if key[k] > 0.0)
        median = own["pressure_median_Pa"]
        spread = (own["pressure_p90_Pa"] - own["pressure_p10_Pa"]) / median
        design = Design(thickness=float(key[0]), cap=float(key[1]), rings=rings)
        yield design, float(key[-1]), own["height_m"], median, spread


def measure_membranes(path: Path = MEASURED) -> list[dict[str, Any]]:
    """Return a dict for each recording: design, weight, heights, recorded and predicted pressures, spread."""
    found = []
    for design, weight, heights, median, spread in recorded(path):
        predicted = lift(design, weight, heights)
        row = {"thickness": design.thickness, "cap": design.cap, "rings": design.rings, "weight": weight}
        curves = {"height": heights, "recorded": median, "predicted": predicted, "spread": spread}
        found.append(row | {name: _plain(values) for name, values in curves.items()})
        print(markdown_table(HEAD, [_row(found[-1])]).splitlines()[-1], flush=True)
    return found


HEAD = (
    "thickness, cap, rings [mm]", "weight [N]", "heights [mm]", "compared", "median error", "largest error",
    "within 6 %", "no equilibrium from",
)  # fmt: skip


def membrane_table(report: list[Mapping[str, Any]]) -> str:
    """Return the table: a row for each design and weight, with errors of the pressure at equal height."""
    return markdown_table(HEAD, [_row(row) for row in report])


def errors(row: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return the heights (k,) [m] and the relative errors of the pressure (k,) of a recording that are compared."""
    heights, median, predicted, spread = (
        np.array(row[name], dtype=np.float64) for name in ("height", "recorded", "predicted", "spread")
    )
    used = (spread <= SPREAD) & np.isfinite(predicted)
    return heights[used], predicted[used] / median[used] - 1.0


def _row(row: Mapping[str, Any]) -> list[str]:
    heights, away = errors(row)
    rings = ", ".join(f"{1e3 * radius:.1f} +- {1e3 * half:.1f}" for radius, half in row["rings"]) or "none"
    lost = np.array(row["height"])[~np.isfinite(np.array(row["predicted"], dtype=np.float64))]
    worst = int(np.argmax(np.abs(away)))
    return [
        f"{1e3 * row['thickness']:g}, {1e3 * row['cap']:.1f}, {rings}",
        f"{row['weight']:g}",
        f"{1e3 * row['height'][0]:.0f} to {1e3 * row['height'][-1]:.0f}",
        f"{len(away)} of {len(row['height'])}",
        f"{100.0 * np.median(away):+.1f} %",
        f"{100.0 * away[worst]:+.1f} % at {1e3 * heights[worst]:.0f} mm",
        f"{100.0 * np.mean(np.abs(away) <= GOAL):.0f} %",
        f"{1e3 * lost[0]:.0f} mm" if len(lost) else "",
    ]


def draw_membranes(folder: Path, report: list[Mapping[str, Any]]) -> None:
    """Draw recorded and predicted pressures against the height, a panel for each design."""
    panels: dict[str, list[Curve]] = {}
    for row in report:
        curves = panels.setdefault(f"{_row(row)[0]} mm", [])
        colour, heights = f"C{len(curves) // 2}", 1e3 * np.array(row["height"])
        curves.append((heights, 1e-3 * np.array(row["recorded"]), {**POINTS, "color": colour}))
        predicted = 1e-3 * np.array(row["predicted"], dtype=np.float64)
        curves.append((heights, predicted, {"color": colour, "label": f"{row['weight']:g} N"}))
    labels = {"x": "height of the cap [mm]", "y": "pressure [kPa]; points: recorded, lines: predicted"}
    draw_panels(folder / "measured_membrane.png", panels, **labels, columns=2)


def probe() -> dict[str, float]:
    """Return the pressure [Pa] of the membrane without rings at two heights under 39.24 N."""
    design = next(item for item in recorded() if not item[0].rings)[0]
    pressures = lift(design, 39.24, [0.010, 0.020])
    return {"pressure at 10 mm [Pa]": float(pressures[0]), "pressure at 20 mm [Pa]": float(pressures[1])}


def _plain(values: Array) -> list[float | None]:
    """Return numbers for a report; None for NaN."""
    return [round(float(value), 6) if np.isfinite(value) else None for value in values]


if __name__ == "__main__":
    run_script(
        "benchmarks.measured_robots.membrane",
        "A membrane that lifts a weight.",
        "measured_membrane",
        measure=measure_membranes,
        tables=membrane_table,
        probe=probe,
        draw=draw_membranes,
        data=MEASURED,
    )
