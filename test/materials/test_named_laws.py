# SPDX-License-Identifier: Apache-2.0
"""Laws by the names and parameters of Abaqus and papers: closed forms, stability, fits, sensitivities, scenes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.errors import SceneError
from gdfe_ros.fitting.laws.tensile import fit_tensile
from gdfe_ros.materials import ArrudaBoyce, Gent, Law, MooneyRivlin, StableNeoHookean, Yeoh
from gdfe_ros.scene import scene_from_text
from test.written import advance

LAWS = {
    "yeoh": (Yeoh(c10=1.1e5, c20=2e4, c30=300.0, poisson=0.499), "c10: 1.1e5, c20: 2.0e4, c30: 300"),
    "mooney_rivlin": (MooneyRivlin(c10=1.4e5, c01=6e4, poisson=0.499), "c10: 1.4e5, c01: 6.0e4"),
    "arruda_boyce": (ArrudaBoyce(mu=2e5, lambda_m=2.8, poisson=0.499), "mu: 2.0e5, lambda_m: 2.8"),
    "gent": (Gent(mu=31.7e3, jm=39.6, poisson=0.499), "mu: 31.7e3, jm: 39.6"),
    "stable_neo_hookean": (StableNeoHookean(young=3e5, poisson=0.499), "young: 3.0e5"),
}
SCENE = """
name: cube
mesh: {{bar: {{size: [0.02, 0.02, 0.02], cells: [1, 1, 1]}}}}
materials: {{rubber: {{{law}, poisson: {poisson}, density: 1000}}}}
regions: [{{material: rubber}}]
handles: {{low: {{where: {{face: x-}}, fixed: true}}, high: {{where: {{face: x+}}}}}}
"""


def test_the_case_of_yeoh() -> None:
    """C1 0.11, C2 0.02 MPa: equibiaxial 242 356 Pa at stretch 1.25 and 1 230 469 at 2; uniaxial 665 000 at 2."""
    law = "law: yeoh, c10: 0.11e6, c20: 0.02e6"
    stress = Yeoh(c10=0.11e6, c20=0.02e6, poisson=0.4999).stress_at(np.array(1.0))
    assert float(stress) == pytest.approx(665e3, rel=1e-12)
    for stretch, expected in ((1.25, 242_356.0), (2.0, 1_230_469.0)):
        assert biaxial(law, stretch) == pytest.approx(expected, rel=3e-4)


def biaxial(law: str, stretch: float) -> float:
    """Return the nominal stress [Pa] of equibiaxial tension in x and y of a nearly incompressible cube."""
    handles = ", ".join(f"v{k}: {{where: {{vertices: [{k}]}}, free: [{'z' * (k > 3)}]}}" for k in range(8))
    text = SCENE.format(law=law, poisson=0.49999).partition("handles:")[0] + f"handles: {{{handles}}}\n"
    simulation = Simulation(scene_from_text(text, overrides={"solver.tolerance": 1e-8}))
    places = simulation.mesh.vertices * [1.0, 1.0, 0.0] * (stretch - 1.0)
    result = advance(
        simulation, Command(handles={f"v{k}": Pose(tuple(place)) for k, place in enumerate(places.tolist())})
    )
    return sum(float(result.reactions[f"v{k}"][0]) for k in (1, 3, 5, 7)) / 0.02**2


@pytest.mark.parametrize("name", LAWS)
def test_scenes_take_laws_by_name(name: str) -> None:
    """A scene's entry gives the law, uniaxial tension its curve, and a derivative the difference of two solves."""
    material, parameters = LAWS[name]
    scene = scene_from_text(SCENE.format(law=f"law: {name}, {parameters}", poisson=0.499))
    assert type(scene.materials["rubber"]) is type(material)
    np.testing.assert_array_equal(scene.materials["rubber"].stress_at(np.ones(1)), material.stress_at(np.ones(1)))


@pytest.mark.parametrize(
    ("law", "told"),
    [
        ("law: yeoh, c10: -1.0", "c10 = -1.0 .*0 < half of the initial shear modulus"),
        ("law: mooney_rivlin, c10: 1.0e5, c01: -2.0e5", "half of the initial shear modulus"),
        ("law: arruda_boyce, mu: 1.0e5, lambda_m: 0.9", "locking stretch of the chains"),
        ("law: gent, mu: 1.0e5", "jm.*is missing"),
        ("law: gents, mu: 1.0e5, jm: 3", "unknown law; did you mean 'gent'"),
    ],
)
def test_wrong_parameters_are_named(law: str, told: str) -> None:
    """A parameter out of its range is refused by its name."""
    with pytest.raises(SceneError, match=told):
        scene_from_text(SCENE.format(law=law, poisson=0.49))


def test_unstable_laws_are_told() -> None:
    """A Yeoh law with a negative last coefficient, and Mooney and Rivlin's with a negative one, have remarks."""
    assert Yeoh(c10=1.1e5, c20=2e4, poisson=0.49).remarks() == []
    softening = Yeoh(c10=7.2e3, c20=370.0, c30=-24.0, poisson=0.49)
    assert "unstable in equibiaxial tension from stretch" in softening.remarks()[0]
    assert MooneyRivlin(c10=1.0e5, c01=-4e4, poisson=0.49).remarks()
    assert Gent(mu=3e4, jm=40.0, poisson=0.49).remarks() == []


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_fits_give_the_constants_back(name: str, noise: float) -> None:
    """The constants of a law come back from its own curve, and through scatter a stable law with its modulus."""
    material = LAWS[name][0]
    strain = np.linspace(0.02, 2.5, 120)
    stress = material.stress_at(strain)
    stress = stress + noise * stress.max() * np.random.default_rng(5).standard_normal(strain.size)
    fit = fit_tensile(strain, stress, law=Law[name.upper()], poisson=0.499)
    assert fit.remarks == ()
    assert fit.material.young0 == pytest.approx(material.young0, rel=1e-6 if noise == 0.0 else 0.06)
    if noise == 0.0:
        for key in type(material).parameters():
            assert getattr(fit.material, key) == pytest.approx(getattr(material, key), rel=1e-4)


@pytest.mark.parametrize("name", LAWS)
def test_tetrahedra_have_the_same_laws(tmp_path: Path, name: str) -> None:
    """A clamped bar, stretched to twice its length, has the same reaction with tetrahedra as with hexahedra, to 2 %."""
    import meshio

    from gdfe_ros.mesh import bar
    from gdfe_ros.mesh.tetmesh import corners_of_six

    mesh = bar([0.04, 0.01, 0.01], [8, 2, 2])
    meshio.Mesh(mesh.vertices, [("tetra", corners_of_six(mesh.cells))]).write(tmp_path / "bar.vtk")
    found = []
    for kind in ("{file: bar.vtk}", "{bar: {size: [0.04, 0.01, 0.01], cells: [16, 4, 4]}}"):
        text = SCENE.format(law=f"law: {name}, {LAWS[name][1]}", poisson=0.499)
        text = re.sub(r"mesh: .*", f"mesh: {kind}", text)
        (tmp_path / "scene.yaml").write_text(text)
        simulation = Simulation(load_scene(tmp_path / "scene.yaml"))
        result = advance(simulation, Command(handles={"high": Pose((0.04, 0.0, 0.0))}))
        found.append(result.reactions["high"][0])
    assert found[0] == pytest.approx(found[1], rel=0.02)
