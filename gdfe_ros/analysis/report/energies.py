# SPDX-License-Identifier: Apache-2.0
"""Energy balance of a run in motion: the body's energy compared with work and dissipation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.analysis.report.history import RunHistory

HAS = "kinetic + elastic + potential"
EXPECTED = "start + work - dissipated"
DIFFERENCE = "difference"
SIZES = {"kinetic": "kinetic energy", "elastic": "elastic energy", "work": "work"}
"""Dict from energy to its name in texts. The error of the balance is compared with the largest of these energies."""


def energy_balance(history: RunHistory) -> dict[str, NDArray[np.float64]]:
    """Return both sides of the energy balance and their difference at each step [J]; empty without dynamics.

    The difference is the energy created or lost by the time integration. It is zero at the beginning of the recording,
    and at each step that starts from a reset or a loaded state.
    """
    if not history.energies:
        return {}
    energy = {name: np.array(values) for name, values in history.energies.items()}
    has = energy["kinetic"] + energy["elastic"] + energy["potential"]
    put = energy["work"] - energy["dissipated"]
    steps = np.arange(len(has))
    starts = np.union1d(0, history.starts).astype(int)
    first = starts[np.searchsorted(starts, steps, side="right") - 1]
    expected = (has - put)[first] + put
    return {HAS: has, EXPECTED: expected, DIFFERENCE: has - expected}


def balance_text(history: RunHistory) -> str:
    """Return a text that states the largest error of the energy balance; empty without dynamics."""
    balance = energy_balance(history)
    if not balance:
        return ""
    most = np.nanmax(np.abs(balance[DIFFERENCE]))
    sizes = {name: np.nanmax(np.abs(history.energies[key])) for key, name in SIZES.items()}
    name = max(sizes, key=sizes.get)
    part = f", {100.0 * most / sizes[name]:.2g} % of the largest {name}" if sizes[name] > 0.0 else ""
    return f"closes to {most:.3g} J{part}"
