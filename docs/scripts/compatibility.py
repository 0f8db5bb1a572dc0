# SPDX-License-Identifier: Apache-2.0
"""The table of files, robots and bags in docs/compatibility.md: each row is a test, counted by pytest's collection."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from benchmarks.markdown import markdown_table

ROOT = Path(__file__).resolve().parents[2]
_HEAD = ("kind", "cases", "made by", "compared with", "test")


class Row(NamedTuple):
    """A kind of file, and the test that reads files of this kind.

    Attributes:
        kind: kind of the files that the test reads.
        made: library or package that made the files.
        compared: values that the result is compared with.
        test: id of the test, without parameters.
    """

    kind: str
    made: str
    compared: str
    test: str


_FILES, _ABAQUS = "test/mesh/files/test_mesh_files.py", "test/mesh/files/test_abaqus.py"
_ARMS = "test/arms/test_distributed.py"
_TABLES, _BAGS = "test/fitting/test_machine_tables.py", "test/recording/test_foreign_bags.py"
ROWS = (
    Row("robots (URDF): frames and holding torques", "example-robot-data", "pinocchio's own reader, 1e-9",
        f"{_ARMS}::test_kinematics_and_torques_are_pinocchios"),
    Row("iiwa (URDF): frames", "rtb-data", "pinocchio's own reader, 1e-9",
        f"{_ARMS}::test_kinematics_of_an_iiwa_are_pinocchios"),
    Row("UR3e, UR5e, 2F-85 (URDF): frames and holding torques", "airo-models", "pinocchio's own reader, 1e-9",
        f"{_ARMS}::test_kinematics_of_arms_and_grippers_of_airo_are_pinocchios"),
    Row("UR3e, 2F-85 in a scene", "airo-models", "number of joints, no mesh is left out",
        f"{_ARMS}::test_an_arm_of_airo_carries_a_body"),
    Row("UR3e, UR5e: lengths", "this test", "the makers' files in airo-models, 1e-9",
        f"{_ARMS}::test_lengths_of_written_arms_are_the_makers"),
    Row("UR3e, UR5e, UR10e, FR3, Gen3, 2F-85 (URDF): frames and holding torques",
        "this test; no package has the URDFs of UR10e, FR3 and Gen3", "pinocchio's own reader, 1e-9",
        f"{_ARMS}::test_kinematics_and_torques_of_written_arms_are_pinocchios"),
    Row("iiwa, UR3e, UR5e, UR10e, FR3, Gen3, 2F-85 (URDF): frames and holding torques",
        "rtb-data (iiwa), this test (others)", "MuJoCo's own reader, 1e-9",
        "test/arms/test_mujoco.py::test_frames_and_torques_are_mujocos"),
    Row("UR5e, UR10e, FR3, Gen3: lengths", "this test",
        "MuJoCo Menagerie: FR3, Gen3 to 1e-9, UR to the millimetres of its models",
        "test/arms/test_mujoco.py::test_lengths_are_those_of_menagerie"),
    Row("iiwa, UR3e, UR5e, UR10e, FR3, Gen3, 2F-85 in a scene", "rtb-data (iiwa), this test (others)",
        "number of joints, remarks", f"{_ARMS}::test_a_written_arm_carries_a_body"),
    Row("robots (URDF) in a scene: visual and collision meshes", "example-robot-data", "number and size of the shapes",
        f"{_ARMS}::test_a_distributed_arm_loads_unchanged"),
    Row("`package://` in folders of all layouts", "this test", "the path", f"{_ARMS}::test_packages_are_found"),
    Row("gmsh 2.2, 4.0, 4.1: ASCII, binary, parametric nodes, all elements saved", "gmsh", "cells and groups in gmsh",
        f"{_FILES}::test_files_of_gmsh"),
    Row("gmsh 1", "gmsh", "cells in gmsh", f"{_FILES}::test_gmsh_version_1"),
    Row("VTK legacy 4.2, 5.1: voxels, hexahedra, Lagrange cells, grids", "VTK", "cells, volume, data",
        f"{_FILES}::test_legacy_files_of_vtk"),
    Row("VTK XML: ASCII, binary, appended; none, zlib, LZ4, LZMA; also as .vtk", "VTK", "cells, volume, data",
        f"{_FILES}::test_xml_files_of_vtk"),
    Row("mesh files that are cut off", "gmsh, VTK", "refused within 10 s, with a remedy",
        f"{_FILES}::test_a_file_that_is_cut_off_is_refused_soon"),
    Row("surfaces (STL, PLY, OBJ, OFF) that are cut off or wrong", "trimesh", "refused with the defect and a remedy",
        f"{_FILES}::test_a_damaged_surface_is_told"),
    Row("Abaqus: instances, moved and turned", "this test", "bounds and volume",
        f"{_ABAQUS}::test_instances_are_placed"),
    Row("Abaqus: sets of nodes", "this test", "number of nodes", f"{_ABAQUS}::test_sets_of_nodes"),
    Row("Abaqus: types of an element", "this test", "number of cells", f"{_ABAQUS}::test_variants_of_an_element"),
    Row("Abaqus: input that would be read wrongly", "this test", "refused with the line and a remedy",
        f"{_ABAQUS}::test_what_cannot_be_read_is_refused_by_line"),
    Row("cells on one side of their common face", "this test", "named with their neighbours",
        "test/mesh/test_same_side.py::test_a_folded_tetrahedron_is_found"),
    Row("tables of testing machines, in three encodings", "this test", "strain and stress",
        f"{_TABLES}::test_layouts_of_machines"),
    Row("tensile tests with slack, scatter and spikes", "this test", "the modulus, 3 %",
        f"{_TABLES}::test_slack_scatter_and_spikes_are_found"),
    Row("bags: MCAP, SQLite, compressed by file or message, Foxy, ROS 1", "rosbags", "times and positions",
        f"{_BAGS}::test_each_kind_has_the_same_messages"),
    Row("bags: bare files without a suffix", "rosbags", "positions",
        f"{_BAGS}::test_bare_files_are_known_by_their_bytes"),
    Row("bags: a position in messages of many types, by a path, ROS 1 and 2", "rosbags", "positions",
        f"{_BAGS}::test_places_in_messages_of_many_types"),
    Row("bags that are cut off", "rosbags", "refused with the kind and a remedy",
        f"{_BAGS}::test_recover_is_suggested_only_for_mcap"),
    Row("published sets of constants", "`materials/published.py`", "law, source, scale",
        "test/materials/test_published.py::test_a_set_says_where_it_comes_from"),
)  # fmt: skip


@lru_cache(maxsize=1)
def case_counts() -> Counter[str]:
    """Return the number of cases of each test of `ROWS`, by its id.

    Raises:
        RuntimeError: pytest cannot collect the tests, or a test does not exist.
    """
    files = sorted({row.test.partition("::")[0] for row in ROWS})
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"pytest cannot collect the tests: {done.stdout[-1000:]}{done.stderr[-1000:]}")
    counts = Counter(line.partition("[")[0] for line in done.stdout.splitlines() if "::" in line)
    if missing := [row.test for row in ROWS if row.test not in counts]:
        raise RuntimeError(f"there are no such tests: {', '.join(missing)}")
    return counts


def compatibility_table() -> str:
    """Return the Markdown table with a row for each test."""
    counts = case_counts()
    rows = [
        [row.kind, str(counts[row.test]), row.made, row.compared, f"`{row.test.partition('::')[2]}`"] for row in ROWS
    ]
    return markdown_table(_HEAD, rows)
