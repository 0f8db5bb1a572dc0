# SPDX-License-Identifier: Apache-2.0
"""Peers are measured fairly, named when missing, and their results survive the transfer between processes."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict

import numpy as np
import pytest

from benchmarks.cases import CASES, Case, CaseName
from benchmarks.grids import Grid
from benchmarks.peers import PeerError, PeerResult, PeerSolution, Solver, Variant, load_peer, run_peer
from benchmarks.peers.mujoco_model import Drive, node_masses, tetrahedra, write_model
from benchmarks.peers.peer import handle_reaction, list_variants
from benchmarks.peers.worker import measure
from benchmarks.process import worker_environment
from benchmarks.references import load_reference


class Stopwatch:
    """A peer that reports given run times."""

    def __init__(self, *times: float) -> None:
        self.left = list(times)

    def available(self) -> str | None:
        """Return None: the peer is available."""
        return None

    def solve(self, case: Case, variant: Variant, points: np.ndarray) -> PeerSolution:
        """Return a solution with the next given time."""
        return PeerSolution(
            displacement=points, reaction=np.zeros(6), time_setup=0.0, time_solve=self.left.pop(0), settings={}
        )


@pytest.mark.parametrize(
    ("times", "counted"),
    [((0.9, 0.1, 0.2, 0.3, 9.9), [0.1, 0.2, 0.3]), ((2.0, 2.1, 2.2, 9.9), [2.0, 2.1, 2.2]), ((6.0, 9.9), [6.0])],
)
def test_short_runs_are_warmed_up_and_long_ones_are_not_repeated(times, counted) -> None:
    """The first of short runs is dropped, all medium runs count, and a long run is made once."""
    case, variant = CASES[CaseName.TENSILE], Variant(label="", element="", cells=(2, 1, 1))
    runs = measure(Stopwatch(*times), case, variant, load_reference(case.name), repeats=3)
    assert [run.time_solve for run in runs] == counted


def test_results_survive_json() -> None:
    """A result rebuilt from its text is equal."""
    result = PeerResult(
        solver=Solver.MUJOCO,
        label="quadratic 10x1x1",
        scene="bend5",
        mesh="10x1x1 quadratic",
        time_setup=0.1,
        time_solve=0.2,
        mean_error=0.003,
        max_error=0.004,
        reaction=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
        settings={"steps": 3, "warnings": ["none to speak of"]},
    )
    assert PeerResult.from_json(json.loads(json.dumps(asdict(result)))) == result


def test_a_missing_peer_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing ccx is an error with the command that installs it, not a skip."""
    monkeypatch.setenv("PATH", "/nowhere")
    variant = list_variants(Solver.CALCULIX, CASES[CaseName.TENSILE])[0]
    with pytest.raises(PeerError, match="apt-get install calculix-ccx"):
        run_peer(Solver.CALCULIX, CaseName.TENSILE, variant)


def test_a_failing_worker_is_reported_with_the_end_of_its_output(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error inside a worker becomes one that names the run and the end of its output."""
    module = load_peer(Solver.CALCULIX)
    monkeypatch.setattr(module, "available", lambda: None)
    variant = Variant(label="C3D99 2x1x1", element="C3D99", cells=(2, 1, 1))
    with pytest.raises(PeerError, match=r"calculix, tensile, C3D99 2x1x1.*\n(.*\n)*.*C3D99"):
        run_peer(Solver.CALCULIX, CaseName.TENSILE, variant)


def test_workers_have_their_threads_pinned() -> None:
    """Every library's thread count is set for a worker, CalculiX's included."""
    environment = worker_environment(1)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER"):
        assert environment[name] == "1"


@pytest.mark.parametrize("solver", list(Solver))
@pytest.mark.parametrize("name", list(CaseName))
def test_every_variant_fits_its_scene(solver: Solver, name: CaseName) -> None:
    """Variants have distinct names, and their cells fit the scene's segments."""
    case = CASES[name]
    variants = list_variants(solver, case)
    labels = [variant.label for variant in variants]
    assert len(set(labels)) == len(labels)
    for variant in variants:
        case.grid(variant.cells)
    assert bool(variants) == (solver is not Solver.MUJOCO or name in (CaseName.BEND5, CaseName.TWIST90_UNIFORM))


def test_the_papers_mesh_is_always_among_the_meshes() -> None:
    """FElupe and CalculiX have a variant with the paper's mesh in every scene."""
    for solver in (Solver.FELUPE, Solver.CALCULIX):
        for case in CASES.values():
            assert case.cells in {variant.cells for variant in list_variants(solver, case)}


def test_the_reaction_is_the_wrench_about_the_deformed_handle() -> None:
    """The reaction is the sum of the handle's forces, and of their moments about the deformed handle's centre."""
    grid = Grid(size=(1.0, 1.0, 1.0), cells=(1, 1, 1))
    forces, displacement = np.zeros((8, 3)), np.tile([0.0, 0.0, 0.5], (8, 1))
    forces[grid.face(right=True)] = [[0, 1, 0], [0, 1, 0], [0, -1, 0], [2, -1, 0]]
    np.testing.assert_allclose(handle_reaction(grid, displacement, forces), [2, 0, 0, 2, 1, -1])


def test_the_mujoco_model_has_a_body_for_every_moving_node() -> None:
    """MuJoCo's model has a body per free node, and a flex per segment that shares its border nodes with the next."""
    case = CASES[CaseName.BEND5]
    grid = case.grid((10, 1, 1), order=2)
    root = ElementTree.fromstring(write_model(case.laws, grid, Drive.HEAVY, timestep=0.2))
    bodies, flexes = root.findall("worldbody/body"), root.findall("deformable/flex")
    assert len(bodies) == len(grid.points()) - 9
    along = [float(body.get("pos").split()[0]) for body in bodies]
    assert along == sorted(along), "bodies in slices across the bar keep MuJoCo's factor narrow"
    assert [flex.find("elasticity").get("young") for flex in flexes] == ["100000", "80000", "60000", "40000", "20000"]
    nodes = [flex.get("node").split() for flex in flexes]
    assert set(nodes[0][-9:]) == set(nodes[1][:9])
    assert nodes[0][:9] == ["world"] * 9


def test_mujoco_nodes_run_fastest_along_z() -> None:
    """The nodes of a flex are listed in MuJoCo's order, with z changing fastest."""
    case = CASES[CaseName.TWIST90_UNIFORM]
    grid = case.grid((2, 1, 1))
    root = ElementTree.fromstring(write_model(case.laws, grid, Drive.MOCAP, timestep=0.2))
    nodes = [int(name.removeprefix("node")) for name in root.find("deformable/flex").get("node").split()[4:]]
    points = grid.points()[nodes]
    order = np.lexsort((points[:, 2], points[:, 1], points[:, 0]))
    np.testing.assert_array_equal(order, np.arange(len(nodes)))


@pytest.mark.parametrize("order", [1, 2])
def test_nodal_masses_sum_to_the_mass_of_the_bar(order: int) -> None:
    """The nodal masses are positive, symmetric and sum to the bar's mass."""
    masses = node_masses(Grid(size=(0.5, 0.05, 0.05), cells=(5, 2, 3), order=order))
    assert masses.sum() == pytest.approx(10.0 * 0.5 * 0.05 * 0.05)
    assert masses.min() > 0
    np.testing.assert_allclose(masses, masses[::-1], rtol=1e-12)


def test_embedded_tetrahedra_fill_the_bar() -> None:
    """The bar is divided into tetrahedra of positive volume without gaps."""
    grid = Grid(size=(0.5, 0.05, 0.05), cells=(3, 2, 1))
    corners = grid.points()[tetrahedra(grid)]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(0.5 * 0.05 * 0.05)


def test_mujoco_has_no_ogden_law() -> None:
    """A scene with an Ogden material is refused for MuJoCo."""
    case = CASES[CaseName.TWIST90]
    with pytest.raises(ValueError, match="OgdenSeries"):
        write_model(case.laws, case.grid(), Drive.HEAVY, timestep=0.2)
