# SPDX-License-Identifier: Apache-2.0
"""Published sets of constants: with law, range, test and reference, and how far they contradict each other."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.materials.published import PUBLISHED, make_published
from test.written import scene_of

SCENE = """
mesh: {{bar: {{size: [0.02, 0.02, 0.02], cells: [1, 1, 1]}}}}
materials: {{skin: {entry}}}
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
"""


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_set_says_where_it_comes_from(name: str) -> None:
    """Each set builds in a scene, and says test, range and reference until it is scaled."""
    one = PUBLISHED[name]
    assert re.fullmatch(r"[a-z][a-z0-9_]*", name)
    assert name.startswith(one.material)
    scene = scene_of(SCENE.format(entry=f"{{published: {name}}}"))
    assert type(scene.materials["skin"]) is type(one.law)
    told = " ".join(Simulation(scene).remarks())
    assert one.reference in told
    assert one.strain in told
    scaled = make_published(name, scale=2.0, poisson=0.45, density=1100.0)
    assert scaled.caveat == ""
    assert (scaled.poisson, scaled.density) == (0.45, 1100.0)
    strain = np.array([0.1, 1.0])
    np.testing.assert_allclose(scaled.stress_at(strain), 2.0 * one.law.stress_at(strain), rtol=1e-12)


def test_contradicting_sets_are_told() -> None:
    """Ecoflex 00-30 has sets from 14 to 34 kPa, which each of them says."""
    told = make_published("ecoflex_00_30_gent_membrane").caveat
    assert "3 sets of ecoflex_00_30 have shear moduli from 14.3 to 34 kPa" in told
    assert "used by the authors for a membrane; range: biaxial, to about stretch 2" in told


@pytest.mark.parametrize(
    ("name", "data", "material", "rms"),
    [
        ("ecoflex_00_50_yeoh_tensile", "silicones_srmd.csv", "Ecoflex 00-50", 0.034),
        ("dragon_skin_30_yeoh_tensile", "silicones_srmd.csv", "Dragon Skin 30", 0.021),
        ("rtv615_yeoh_tensile", "silicones_srmd.csv", "RTV615", 0.011),
    ],
)
def test_own_fits_match_their_tests(name: str, data: str, material: str, rms: float) -> None:
    """The sets that were fitted here miss the points of their test by the stated root mean square."""
    path = Path(__file__).parents[1] / "data" / "measured" / data
    rows = [row for row in csv.DictReader(path.open()) if row["material"] == material]
    strain, stress = (
        np.array([float(row[key]) for row in rows]) for key in ("engineering_strain", "nominal_stress_Pa")
    )
    used = (strain >= 0.1) & (strain <= (1.5 if "RTV" in material else 2.0))
    misfit = PUBLISHED[name].law.stress_at(strain[used]) / stress[used] - 1.0
    assert float(np.sqrt(np.mean(misfit**2))) == pytest.approx(rms, abs=2e-3)
