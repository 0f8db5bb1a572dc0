# SPDX-License-Identifier: Apache-2.0
"""A clamped bar under its weight: quadratic tetrahedra neither lock nor hourglass."""

from __future__ import annotations

import pytest

from benchmarks.tets.bar import sag
from gdfe_ros.materials import Material, NeoHookean, Ogden
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.tetmesh import divided

CONVERGED = {0.45: 18.0e-3, 0.4999: 17.8e-3}
"""Sag of the tip [m] on fine meshes of tetrahedra and of hexahedra (benchmarks.tets)."""


@pytest.mark.parametrize("poisson", CONVERGED)
def test_a_clamped_bar_sags_within_one_per_cent(poisson: float) -> None:
    """Divide 10 x 2 x 2 cubes into six tetrahedra each: linear ones reach a third of this sag, or a tenth."""
    found = sag(divided(bar([0.1, 0.02, 0.02], [10, 2, 2])), NeoHookean(young=2e5, poisson=poisson))
    assert found.metres == pytest.approx(CONVERGED[poisson], rel=0.01)


@pytest.mark.parametrize(
    "law",
    [NeoHookean(young=2e5, poisson=0.4999), Ogden(mu=(2e5 / 3.0,), alpha=(2.0,), poisson=0.4999)],
    ids=["neo-hookean", "ogden"],
)
def test_the_sag_converges_with_the_mesh(law: Material) -> None:
    """Come within 0.4 % of the next finer mesh, and nearer with each refinement, for laws of isochoric strain, too."""
    sags = [sag(divided(bar([0.1, 0.02, 0.02], cells)), law).metres for cells in ([5, 1, 1], [10, 2, 2], [20, 4, 4])]
    assert sags[1] == pytest.approx(sags[2], rel=0.005)
    assert abs(sags[1] - sags[2]) < abs(sags[0] - sags[2])
