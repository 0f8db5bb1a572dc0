# SPDX-License-Identifier: Apache-2.0
"""The start of a step in time: prediction by free flight."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Simulation
from test.written import scene_of

TEXT = """\
mesh: {{bar: {{size: [0.12, 0.01, 0.01], cells: [36, 3, 3]}}}}
materials: {{rubber: {{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1100}}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
loads: {{pull: {{point: {{at: [0.12, 0.005, 0.005], force: [0, 0, 0.03]}}}}}}
dynamics: {{step: {step}}}
"""


def test_a_force_at_a_light_vertex_leads_where_short_steps_lead() -> None:
    """A corner that its force alone would move by 25 cells a step moves as with short steps, without added energy."""
    moved = {}
    for step in (0.0005, 0.005):
        simulation = Simulation(scene_of(TEXT.format(step=step)))
        before = simulation.positions.copy()
        results = [simulation.step() for _ in range(round(0.01 / step))]
        assert all(result.converged for result in results)
        moved[step] = (simulation.positions - before)[-1]
        assert sum(results[-1].energies[name] for name in ("kinetic", "elastic", "potential")) < 1e-9
    np.testing.assert_allclose(moved[0.005], moved[0.0005], atol=0.2 * np.linalg.norm(moved[0.0005]))
    assert moved[0.005][2] == pytest.approx(moved[0.0005][2], rel=0.2)
