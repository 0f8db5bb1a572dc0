# SPDX-License-Identifier: Apache-2.0
"""Scenes are loaded by name, path and text, with overrides, and rebuilt from their source."""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from gdfe_ros.errors import SceneError
from gdfe_ros.materials import Curve, Linear
from gdfe_ros.scene import Scene, load_scene, scene_from_text, scene_names
from gdfe_ros.solver.settings import Policy


def assert_same(one: Scene, two: Scene) -> None:
    """Compare everything that the solver uses."""
    np.testing.assert_array_equal(one.mesh.vertices, two.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.cells, two.mesh.cells)
    np.testing.assert_array_equal(one.cell_material, two.cell_material)
    assert one.materials == two.materials
    assert list(one.materials) == list(two.materials)
    assert (one.name, one.program, one.solver) == (two.name, two.program, two.solver)
    for a, b in zip(one.handles, two.handles, strict=True):
        assert (a.name, a.fixed, a.free, a.vertices.tolist()) == (b.name, b.fixed, b.free, b.vertices.tolist())


@pytest.mark.parametrize("name", scene_names())
def test_shipped_scenes_rebuild_from_their_source(name: str) -> None:
    """Each shipped scene is the same when it is rebuilt from its source."""
    scene = load_scene(name)
    assert scene.name == name
    assert_same(scene_from_text(scene.source), scene)


def test_tensile_curve_uses_the_polynomials() -> None:
    """tensile_curve stretches 0.04 m by 100 % with the curve law."""
    scene = load_scene("tensile_curve")
    assert all(isinstance(material, Curve) for material in scene.materials.values())
    assert scene.materials["cheetah"].data.initial_modulus == pytest.approx(19.13e6)
    assert scene.program.handle_poses(1.0)["tip"].translation == (0.04, 0.0, 0.0)


def test_calibration_gives_shape_factors() -> None:
    """The scene calibration has omega 0.9 and 0.03, the policy relative, and moduli in the ratio of Eq. 7."""
    scene = load_scene("calibration")
    left, right = scene.materials.values()
    assert (left.omega, right.omega) == (0.9, 0.03)
    assert scene.solver.policy is Policy.RELATIVE
    ratio = left.young / right.young
    assert 0.0017 * ratio**2 + 1.42245 * ratio - 0.4141 == pytest.approx(30, rel=1e-3)


def test_later_regions_win(sound: str) -> None:
    """A later region replaces the material of its cells only."""
    scene = scene_from_text(sound)
    np.testing.assert_array_equal(scene.cell_material, scene.mesh.centroids[:, 0] > 0.1)
    assert scene.cell_material.dtype == np.int32
    assert list(scene.materials) == ["soft", "hard"]


def test_numbers_such_as_1e5_are_numbers(sound: str) -> None:
    """1e5, which is text in YAML 1.1, and quoted numbers are read as numbers."""
    assert scene_from_text(sound).materials["soft"] == Linear(young=1e5, poisson=0.45)
    quoted = scene_from_text(sound.replace("1e5", "'1E+5'"))
    assert quoted.materials["soft"].young == 1e5


def test_overrides_replace_values_before_validation(sound: str) -> None:
    """Overrides set a number, a list, a list item, a text that is YAML, and a key that is not in the file."""
    scene = scene_from_text(
        sound,
        overrides={
            "materials.soft.poisson": 0.3,
            "mesh.bar.cells": np.array([8, 1, 1]),
            "program.handles.tip.1.translation": (0, 0, 0.2),
            "solver.policy": "relative",
            "solver.steps": "7",
        },
    )
    assert scene.materials["soft"].poisson == 0.3
    assert scene.mesh.n_cells == 8
    assert scene.program.handle_poses(2.0)["tip"].translation == (0, 0, 0.2)
    assert (scene.solver.policy, scene.solver.steps) == (Policy.RELATIVE, 7)
    assert_same(scene_from_text(scene.source), scene)


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("materials.soft.young.x", "materials.soft.young is 100000.0 and has no keys"),
        ("regions.2.material", "regions is a list; allowed: an index 0 to 1"),
        ("materials.soft.yung", "materials.soft.yung (override): unknown key; did you mean 'young'?"),
    ],
)
def test_overrides_that_lead_nowhere_are_defects(sound: str, key: str, expected: str) -> None:
    """A defect of an override names the override, not a line of the file."""
    with pytest.raises(SceneError) as caught:
        scene_from_text(sound, overrides={key: 1.0})
    assert expected in str(caught.value)


@pytest.mark.parametrize("overrides", [["solver.tolerance"], {1: 2.0}, "solver.tolerance=1e-6"])
def test_overrides_that_are_no_dict_are_refused(sound: str, overrides: Any) -> None:
    """Overrides without dotted keys are refused with the form that is allowed."""
    with pytest.raises(SceneError, match=r"overrides = .*allowed is a dict from dotted key to value"):
        scene_from_text(sound, overrides=overrides)


def test_an_override_of_none_leaves_a_key_out(sound: str) -> None:
    """An override of None removes the program, and the source, as in bags, is read as the same scene."""
    for nothing in (None, "null"):
        scene = scene_from_text(sound, overrides={"program": nothing})
        assert scene.program is None
        assert "program" not in scene_from_text(scene.source).source


def test_source_is_the_file_itself_when_nothing_is_put_in(sound: str) -> None:
    """Without overrides, the source is the file with its comments and layout."""
    assert scene_from_text("# mine\n" + sound).source == "# mine\n" + sound


def test_curves_from_csv_are_put_into_the_source(tmp_path: Path, sound: str) -> None:
    """Curves from csv files beside the scene are put into the source, which needs no file."""
    strain = [0.0, 0.1, 0.35, 1.0]
    stress = [0.0, 1.1e4, 3.3e4, 7.123456789012345e4]
    rows = "\n".join(f"{e!r};{s!r}" for e, s in zip(strain, stress, strict=True))
    (tmp_path / "test.csv").write_text(f"# a comment\nStrain;Stress\n{rows}\n")
    text = sound.replace("law: linear, young: 1e5", "law: curve, csv: test.csv")
    (tmp_path / "mine.yaml").write_text(text)
    scene = load_scene(tmp_path / "mine.yaml")
    assert scene.path == tmp_path / "mine.yaml"
    assert scene.materials["soft"].data.stress == tuple(stress)
    assert "test.csv" not in scene.source
    assert_same(scene_from_text(scene.source), scene)


def test_a_scene_is_found_by_name_and_by_path(tmp_path: Path, sound: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name with a folder or a suffix is a path; otherwise a shipped scene has priority."""
    (tmp_path / "mine.yml").write_text(sound)
    monkeypatch.chdir(tmp_path)
    assert load_scene("mine.yml").name == "sound"
    assert load_scene(str(tmp_path / "mine.yml")).name == "sound"
    assert load_scene("bend5").path.name == "bend5.yaml"


@pytest.mark.parametrize("target", ["gone.yaml", "link.yaml"])
def test_a_link_to_no_file_is_named_with_its_target(tmp_path: Path, target: str) -> None:
    """A scene that is a link to a missing file, or to itself, is refused as a link, without suggesting itself."""
    link = tmp_path / "link.yaml"
    link.symlink_to(tmp_path / target)
    with pytest.raises(SceneError, match=rf"a link to .*{target}, which leads to no file"):
        load_scene(link)


def test_a_missing_scene_lists_what_there_is(tmp_path: Path) -> None:
    """An unknown scene is refused with the closest name and all names."""
    with pytest.raises(
        SceneError, match=r"bend6: .*\n.*did you mean 'bend5'\? scenes: arm_grasp, arm_pneunet, ball_drop"
    ):
        load_scene("bend6")
    with pytest.raises(SceneError, match=r"does not exist"):
        load_scene(tmp_path / "no.yaml")
    with pytest.raises(SceneError, match=r"is a directory"):
        load_scene(tmp_path)
    (tmp_path / "ball_gripper.yaml").write_text("name: mine")
    with pytest.raises(SceneError, match=r"does not exist; did you mean '.*/ball_gripper.yaml'\? scenes: arm_grasp"):
        load_scene(tmp_path / "ball_griper.yaml")


def test_a_binary_file_is_not_a_scene(tmp_path: Path) -> None:
    """A binary file, such as a bag, is refused as no YAML file."""
    (tmp_path / "run.mcap").write_bytes(b"\x89MCAP0\r\n\xff\xfe\x00")
    with pytest.raises(SceneError, match=r"cannot be read as text.*a scene is a YAML file"):
        load_scene(tmp_path / "run.mcap")


@pytest.mark.bench
def test_loading_is_quick() -> None:
    """After all imports, the 1250 cells of bend5 load within 50 ms of processor time (best of five)."""
    times = []
    for _ in range(5):
        start = process_time()
        load_scene("bend5")
        times.append(process_time() - start)
    assert min(times) < 0.05
