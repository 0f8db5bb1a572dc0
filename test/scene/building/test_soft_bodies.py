# SPDX-License-Identifier: Apache-2.0
"""Soft bodies beside the body of a scene: selections do not see them, and they join and leave a motion."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import OverlapError, SceneError
from gdfe_ros.installation import share_dir
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.generators import bar
from gdfe_ros.node.driving.remodelling import take_over
from gdfe_ros.scene import entity, load_scene, scene_from_text
from gdfe_ros.scene.entity import Entity, read_entity, with_body, without_bodies
from gdfe_ros.simulation import Simulation
from gdfe_ros.simulation_parts.soft_places import require_soft_free
from test.written import advance

GEL = "{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1070}"
BAR = "{bar: {size: [0.03, 0.03, 0.03], cells: [2, 2, 2]}}"
CUBE = f"{BAR[:-1]}, material: {GEL}}}"
PLACE, TURN = np.array([0.3, 0.0, 0.2]), Rotation.from_rotvec([0.0, 0.0, 0.5])


def _entity(mesh: dict) -> Entity:
    return read_entity(yaml.safe_dump({**mesh, "material": yaml.safe_load(GEL)}))


def _changed(slab: Path, **changes: object) -> str:
    return yaml.safe_dump({**yaml.safe_load(slab.read_text()), **changes})


def test_selections_without_a_mesh_do_not_see_soft_bodies(slab: Path) -> None:
    """Handles, materials and contact faces of the body stay; ids of its vertices and cells do, too."""
    plain = load_scene(slab)
    scene = with_body(plain, "gel", read_entity(CUBE), origin=PLACE, turn=TURN)
    assert scene.soft_bodies == ("gel",)
    assert (scene.mesh.vertices[: plain.mesh.n_vertices] == plain.mesh.vertices).all()
    assert (scene.cell_material[: plain.mesh.n_cells] == plain.cell_material).all()
    for old, new in zip(plain.handles, scene.handles, strict=True):
        count = len(old.vertices)
        assert len(new.vertices) == count
    assert list(scene.materials) == [*plain.materials, "gel"]
    again = scene_from_text(scene.source)
    assert (again.mesh.vertices == scene.mesh.vertices).all()
    assert list(without_bodies(scene, ["gel"]).materials) == list(plain.materials)


def test_a_body_of_two_materials_has_them_in_its_own_frame(slab: Path) -> None:
    """The shipped ball keeps its core, also where it is turned and elsewhere; materials are named after the body."""
    ball = read_entity((share_dir() / "config" / "bodies" / "soft_ball.yaml").read_text())
    scene = with_body(load_scene(slab), "ball", ball, origin=PLACE, turn=TURN)
    part = scene.mesh.parts["ball"]
    own = scene.cell_material[part.first_cell :]
    inner = np.linalg.norm(part.mesh.centroids, axis=1) < 0.008
    names = list(scene.materials)
    assert (own[inner] == names.index("ball_core")).all()
    assert (own[~inner] == names.index("ball_skin")).all()


def test_two_hundred_soft_bodies_in_turn_neither_leak_nor_jump(slab: Path) -> None:
    """The rest does not move by a bit in an exchange, energies close, memory levels off, and the end is the same."""
    sharp = {"solver.tolerance": 1e-7}
    cube, simulation, used = read_entity(CUBE), Simulation(load_scene(slab, overrides=sharp)), []
    advance(simulation, dt=0.005, count=4)
    count, start = simulation.mesh.n_vertices, simulation.snapshot()
    for number in range(200):
        name = f"gel{number}"
        for joins in (True, False):
            scene = simulation.scene
            changed = with_body(scene, name, cube, origin=PLACE, turn=TURN) if joins else without_bodies(scene, [name])
            new = Simulation(changed)
            take_over(simulation, new)
            assert (new.positions[:count] == simulation.positions[:count]).all()
            unaccounted = simulation.stepper.find_imbalance(simulation.state)
            assert new.stepper.find_imbalance(new.state) == pytest.approx(unaccounted, abs=1e-12)
            simulation = new
            if number % 50 == 0:
                assert simulation.step(dt=0.005).converged
        if number % 20 == 19:
            gc.collect()
            used.append(len(gc.get_objects()))
    assert max(used[5:]) - max(used[1:5]) < 100
    reference = Simulation(load_scene(slab, overrides=sharp))
    reference.restore(start)
    advance(reference, dt=0.005, count=8)
    assert simulation.time == pytest.approx(reference.time)
    assert np.abs(simulation.positions - reference.positions).max() < 1e-9


def test_a_soft_body_does_not_join_where_something_is(slab: Path) -> None:
    """The place must be free of the body, of rigid bodies and of obstacles."""
    scene = load_scene(slab)
    simulation, cube = Simulation(scene), read_entity(CUBE)
    simulation.step(dt=0.005)
    with pytest.raises(SceneError, match="lies in mesh 'mesh'"):
        with_body(scene, "gel", cube, origin=scene.mesh.bounds.mean(axis=0), turn=TURN)
    table = next(each for each in scene.handles if not len(each.vertices))
    below = np.add(table.origin, [0.5, 0.0, -0.01])
    new = Simulation(with_body(scene, "gel", cube, origin=below, turn=Rotation.identity()))
    with pytest.raises(OverlapError, match=r"soft body 'gel' is .* inside of obstacle"):
        take_over(simulation, new)


def test_a_soft_body_joins_while_a_rigid_one_is_pressed_into_another_surface(slab: Path) -> None:
    """Only the new body's place is tested: a part that has sunk into the slab is its contact's matter."""
    scene = with_body(load_scene(slab), "gel", read_entity(CUBE), origin=PLACE, turn=TURN)
    part = next(iter(scene.rigid_bodies))
    simulation = Simulation(scene)
    positions = simulation.state.positions + simulation.origin
    poses = dict.fromkeys([each.name for each in scene.handles], Pose())
    middle = scene.mesh.parts["mesh"].mesh.bounds.mean(axis=0)
    positions[part.vertices] += middle - positions[part.vertices].mean(axis=0)
    require_soft_free(scene, poses, positions, ["gel"])
    positions[part.vertices] += PLACE - middle
    with pytest.raises(OverlapError, match="part"):
        require_soft_free(scene, poses, positions, ["gel"])


def test_materials_leave_with_their_body(slab: Path) -> None:
    """A material that no region names does not join: it would stay, and the same body could not join again."""
    plain, two = (
        load_scene(slab),
        f"{BAR[:-1]}, materials: {{core: {GEL}, skin: {GEL}}}, regions: [{{material: core}}]}}",
    )
    for _ in range(2):
        scene = with_body(plain, "gel", read_entity(two), origin=PLACE, turn=TURN)
        assert list(scene.materials) == [*plain.materials, "gel_core"]
        plain = without_bodies(scene, ["gel"])


def test_a_packed_body_joins(slab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A body of an embedded mesh joins; its cells are counted after it is unpacked."""
    scene, packed = load_scene(slab), _entity({"embedded": pack_mesh(bar((0.03, 0.03, 0.03), (2, 2, 2)))})
    joined = with_body(scene, "gel", packed, origin=PLACE, turn=TURN)
    assert joined.mesh.parts["gel"].mesh.n_cells == 8
    monkeypatch.setattr(entity, "MOST_CELLS", 7)
    with pytest.raises(SceneError, match="its mesh has 8 cells; allowed for a body that joins: 7"):
        with_body(scene, "gel", packed, origin=PLACE, turn=TURN)


@pytest.mark.parametrize("edge", [1e-5, 5.0])
def test_a_body_of_another_size_does_not_join(slab: Path, edge: float) -> None:
    """Beside a body of 10 um, steps of the scene's body were wrong by five tolerances; a large one loosens them."""
    cube = _entity({"bar": {"size": [edge] * 3, "cells": [2, 2, 2]}})
    with pytest.raises(SceneError, match=r"its size is .* allowed for a body that joins: .*, because the scene's body"):
        with_body(load_scene(slab), "gel", cube, origin=PLACE, turn=TURN)


@pytest.mark.parametrize("mesh", ["voxels: {{surface: {}, cell: 3.0e-4}}", "tets: {{surface: {}, size: 1.0e-3}}"])
def test_a_filled_surface_of_too_many_cells_is_not_made(tmp_path: Path, mesh: str) -> None:
    """Cubes and tetrahedra are counted before they are made: 1e6 of them took minutes and gigabytes."""
    trimesh.creation.box((0.03, 0.03, 0.03)).export(path := tmp_path / "cube.stl")
    with pytest.raises(SceneError, match=r"its mesh has about .* cells; allowed for a body that joins: 20000"):
        read_entity(f"{{{mesh.format(path)}, material: {GEL}}}")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("materials: {x: {}}, regions: [{material: x}, {material: soft}]", "'soft'; allowed: its own materials: x"),
        ("materials: {x: {}}, regions: 5", "regions is 5; allowed: a list"),
        ("materials: {x: {}}", "regions is None; allowed: a list"),
        ("material: {}, regions: [{material: soft}]", "it has material and regions"),
    ],
)
def test_a_body_that_joins_has_its_own_materials(text: str, reason: str) -> None:
    """With a material of the scene it could not leave again, because its leaving took this material along."""
    with pytest.raises(SceneError, match=reason):
        read_entity(f"{BAR[:-1]}, {text}}}")


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"bar": {"size": [0.1, 0.1, 0.1], "cells": [1, 1, 1]}}, "exactly one of material and regions"),
        ({"bar": {"size": [0.01, 0.01, 0.01], "cells": [1, 1, 1]}, "material": "sof"}, "did you mean 'soft'"),
        ({"bar": {"size": [9, 9, 9], "cells": [1, 1, 1]}, "material": "soft"}, "lies in mesh"),
    ],
)
def test_defects_are_named(slab: Path, entry: dict, text: str) -> None:
    """The error names the entry and what is wrong."""
    with pytest.raises(SceneError, match=text) as error:
        scene_from_text(_changed(slab, soft_bodies={"gel": entry}))
    assert "soft_bodies" in str(error.value)


def test_names_are_unique_and_soft_bodies_can_move(slab: Path) -> None:
    """A rigid body's name is taken; without `dynamics` nothing holds a soft body."""
    entry = {"bar": {"size": [0.01, 0.01, 0.01], "cells": [1, 1, 1]}, "material": "soft", "at": [0.5, 0, 0.5]}
    with pytest.raises(SceneError, match="a body has this name"):
        scene_from_text(_changed(slab, soft_bodies={"part": entry}))
    data = yaml.safe_load((share_dir() / "config" / "scenes" / "bend5.yaml").read_text())
    data["soft_bodies"] = {"gel": {**entry, "material": next(iter(data["materials"]))}}
    with pytest.raises(SceneError, match="nothing holds them"):
        scene_from_text(yaml.safe_dump(data))
