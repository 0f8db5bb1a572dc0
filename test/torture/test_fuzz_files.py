# SPDX-License-Identifier: Apache-2.0
"""Fuzzing of every reader of files: any bytes are read or refused by name, in bounded time and memory.

The readers run in a child process with limits of memory and processor time.
"""

from __future__ import annotations

import subprocess
import sys

import pytest

from test.torture.examples import EXAMPLES

COUNT, SECONDS_EACH = EXAMPLES or 100, 10.0
_MEMORY = 6 << 30
"""Address space of the child [bytes]; most of it is that of the libraries."""
_CHILD = """
import resource, sys, time
from pathlib import Path
import numpy as np
import trimesh
from gdfe_ros.arms.urdf import parse_urdf
from gdfe_ros.analysis.sweep import read_list
from gdfe_ros.checkpoint import load_state, save_state
from gdfe_ros.errors import GdfeError
from gdfe_ros.fitting.csv_source import TableFile
from gdfe_ros.mesh.files.importer import read_mesh
from gdfe_ros.mesh.files.stored_mesh import pack_mesh, unpack_mesh
from gdfe_ros.mesh.meshing.voxels import examine_surface
from gdfe_ros.scene import load_scene
from gdfe_ros.scene.schemas.machine_table import read_stress_table
from gdfe_ros.simulation import Simulation
import meshio
from hypothesis import HealthCheck, given, settings, strategies as st

kinds, count, patience, folder = sys.argv[1].split(), int(sys.argv[2]), float(sys.argv[3]), Path(sys.argv[4])
simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1]}))
mesh = simulation.mesh
box = meshio.Mesh(mesh.vertices, [("hexahedron", mesh.cells)])
URDF = '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
URDF += 'iyz="0"/></inertial></link></robot>'

def sound(kind, suffix):
    path = folder / f"sound{suffix}"
    match kind:
        case "scene": return simulation.scene.source.encode()
        case "state": return save_state(simulation)
        case "packed": return pack_mesh(mesh).encode()
        case "urdf": return URDF.encode()
        case "table": return b"time [s],x [mm]\\n0,1\\n0.1,2\\n"
        case "stress": return b"strain,stress\\n0.1,1000\\n0.2,2000\\n"
        case "cases": return b"- {materials.soft.young: 1e5}\\n- {materials.soft.young: 2e5}\\n"
        case "surface": trimesh.creation.box().export(path)
        case _: box.write(path)
    return path.read_bytes()

READERS = {
    "scene": (".yaml", load_scene),
    "state": (".bin", lambda path: load_state(simulation, path.read_bytes())),
    "packed": (".txt", lambda path: unpack_mesh(path.read_bytes().decode("latin-1"))),
    "urdf": (".urdf", lambda path: parse_urdf(path.read_bytes().decode("latin-1"))),
    "table": (".csv", TableFile),
    "stress": (".csv", read_stress_table),
    "cases": (".yaml", read_list),
    "surface": (".stl", lambda path: examine_surface(path, scale=1.0)),
    "vtk": (".vtk", read_mesh),
    "vtu": (".vtu", read_mesh),
    "inp": (".inp", read_mesh),
    "msh": (".msh", read_mesh),
}
resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
ODD = [b"-1", b"9" * 30, b"1e308", b"nan", b"\\0", b"[[[", b"<!ENTITY a>", b"&a [*a]"]

def changed(seed, dice):
    data = bytearray(seed)
    for _ in range(dice.randrange(1, 6)):
        place = dice.randrange(len(data) + 1)
        match dice.randrange(6):
            case 0: data[place : place + 1] = bytes([dice.randrange(256)])
            case 1: del data[place : place + dice.randrange(200)]
            case 2: data[place:place] = dice.randbytes(dice.randrange(60))
            case 3: data[place:place] = data[: dice.randrange(len(data) + 1)]
            case 4: data[place:place] = dice.choice(ODD)
            case 5: data[place : place + 4] = b"\\xff\\xff\\xff\\x7f"
    return bytes(data) if dice.random() < 0.9 else dice.randbytes(dice.randrange(5000))

for kind in kinds:
    suffix, read = READERS[kind]
    seed, slowest, refused = sound(kind, suffix), 0.0, 0
    errors = (GdfeError, ValueError) if kind == "stress" else GdfeError

    few = count // 5 if kind == "msh" else count  # gmsh starts anew for each file

    @settings(max_examples=few, deadline=None, database=None, derandomize=not LONG, suppress_health_check=HealthCheck)
    @given(st.randoms(use_true_random=False))
    def check(dice):
        global slowest, refused
        path = folder / f"file{suffix}"
        path.write_bytes(changed(seed, dice))
        began = time.process_time()
        try:
            read(path)
        except errors:
            refused += 1
        slowest = max(slowest, time.process_time() - began)
        assert slowest < patience, (kind, slowest)

    check()
    print(f"{kind}: {few} files, {refused} refused, at most {slowest:.2f} s")
""".replace("MEMORY, MEMORY", f"{_MEMORY}, {_MEMORY}").replace("not LONG", str(not EXAMPLES))


@pytest.mark.parametrize("kinds", ["scene state packed urdf table stress cases surface", "vtk vtu", "inp msh"])
def test_any_file_is_read_or_refused(kinds: str, tmp_path: object) -> None:
    """Damaged and random files of each kind are read, or refused by an error of this package, and never crash."""
    command = [sys.executable, "-X", "faulthandler", "-c", _CHILD, kinds, str(COUNT), str(SECONDS_EACH), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600 + COUNT * SECONDS_EACH, check=False)
    print(done.stdout)
    assert done.returncode == 0, done.stderr[-3000:]
