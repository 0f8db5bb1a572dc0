# SPDX-License-Identifier: Apache-2.0
"""Bodies of quadratic tetrahedra touch each other and themselves, by the triangles between the nodes of their faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.mesh import HexMesh, Mesh, bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.scene import Scene, scene_from_text
from gdfe_ros.scene.document import write_document
from test.written import advance

GAP = 1e-4


def _scene(**entries: Any) -> Scene:
    given = {
        "name": "touching",
        "materials": {"rubber": {"law": "neo_hookean", "young": 1e5, "poisson": 0.0, "density": 1000}},
        "regions": [{"material": "rubber"}],
        "self_contact": {},
        "solver": {"tolerance": 1e-5},
    }
    return scene_from_text(write_document({**given, **entries}))


def _slabs(**entries: Any) -> Scene:
    """Return two slabs of tetrahedra, whose meshes do not match, with a gap between them."""
    low, high = (divide(bar([0.1, 0.1, 0.04], [n, n, 1])) for n in (3, 2))
    meshes = {"low": {"embedded": pack_mesh(low)}, "high": {"embedded": pack_mesh(high), "at": [0.0, 0.0, 0.04 + GAP]}}
    handles = {
        "base": {"where": {"mesh": "low", "face": "z-"}, "fixed": True},
        "top": {"where": {"mesh": "high", "face": "z+"}},
    }
    return _scene(meshes=meshes, handles=handles, **entries)


def test_two_slabs_press_evenly() -> None:
    """Two slabs of nu = 0 that do not match bear the uniaxial force of their compression, within 2 %."""
    simulation = Simulation(_slabs())
    for down in (0.002, 0.004, 0.006, 0.008):
        result = advance(simulation, Command(handles={"top": Pose((0.0, 0.0, -down - GAP))}))
    stretch = 0.9
    exact = -0.5 * 1e5 * (stretch - 1.0 / stretch) * 0.01
    assert -result.reactions["top"][2] == pytest.approx(exact, rel=0.02)
    assert result.reactions["base"][2] == pytest.approx(-result.reactions["top"][2], rel=1e-3)


def test_friction_drags_the_lower_slab() -> None:
    """An upper slab that slides drags the lower one by the friction coefficient times the pressing force."""
    simulation = Simulation(_slabs(self_contact={"friction": 0.1}))
    for down in (0.002, 0.004):
        simulation.step(Command(handles={"top": Pose((0.0, 0.0, -down - GAP))}))
    result = advance(simulation, Command(handles={"top": Pose((0.002, 0.0, -0.004 - GAP))}))
    assert result.contacts["(self)"].slips.all()
    assert result.reactions["top"][0] == pytest.approx(-0.1 * result.reactions["top"][2], rel=0.1)


def _slit() -> HexMesh:
    """Return a body with a slit, whose lips are mirror images of each other."""
    mesh = bar([0.06, 0.02, 0.03], [6, 1, 5])
    centre = mesh.vertices[mesh.cells].mean(axis=1)
    return keep_cells(mesh, ~((np.abs(centre[:, 2]) < 0.003) & (centre[:, 0] > 0.02)))


@pytest.mark.parametrize(
    ("body", "friction", "steps"),
    [(divide(_slit()), 0.1, 4), (divide(_slit()), 0.4, 12), (_slit(), 0.0, 8), (_slit(), 0.1, 12)],
    ids=["tetrahedra", "tetrahedra, rough", "hexahedra, smooth", "hexahedra"],
)
@pytest.mark.parametrize("dynamics", [None, {"step": 0.005, "damping": {"viscosity": 300}}], ids=["statics", "motion"])
def test_a_slit_closes_on_itself(body: Mesh, friction: float, steps: int, dynamics: dict[str, Any] | None) -> None:
    """The lips of a slit meet, rim on rim, when the body is folded, and do not enter each other."""
    given = {"self_contact": {"friction": friction}, **({} if dynamics is None else {"dynamics": dynamics})}
    lips = {side: {"where": {"box": {"x": [0.0599, 0.061], "z": z}}} for side, z in
            (("low", [-1.0, -0.0089]), ("high", [0.0089, 1.0]))}  # fmt: skip
    given["solver"] = {"tolerance": 1e-4}
    simulation = Simulation(_scene(mesh={"embedded": pack_mesh(body)}, handles=lips, **given))
    for part in np.linspace(1.0 / steps, 1.0, steps):
        command = Command(handles={"low": Pose((0.0, 0.0, 0.0042 * part)), "high": Pose((0.0, 0.0, -0.0042 * part))})
        result = advance(simulation, command, dt=0.05)
    squeezed = result.reactions["low"][2]
    assert squeezed > 0.5
    term = next(term for term in simulation.stepper.equilibrium.actuation.contacts if term.name == "(self)")
    depths, _ = term.penetration.depths(simulation.state.positions, 1e-5)
    assert depths.max() < 2e-4


def test_how_deep_a_body_is_inside_of_another_one_is_known() -> None:
    """If the upper slab is moved into the lower one by 1 mm, nodes between faces are found, 1 mm deep."""
    simulation = Simulation(_slabs())
    body, meant = simulation.stepper.body, simulation.stepper.body.self_contact
    term = next(term for term in simulation.stepper.equilibrium.actuation.contacts if term.name == "(self)")
    x = body.rest.copy()
    x[meant.parts["high"] :, 2] -= GAP + 1e-3
    depths, cells = term.penetration.depths(x, 1e-5)
    found = depths[depths > 0.0]
    assert len(found) > 20
    np.testing.assert_allclose(found, 1e-3, rtol=1e-6)
    assert (cells >= 0).sum() == len(found)
