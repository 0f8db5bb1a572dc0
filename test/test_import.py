# SPDX-License-Identifier: Apache-2.0
"""Importing the package is cheap, needs no ROS, and has no cycles."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import gdfe_ros
from gdfe_ros.errors import GdfeError
from gdfe_ros.installation import share_dir
from test.written import run_python

ROOT = Path(__file__).parents[1]
ROOMS = sorted({path.parent for path in (ROOT / "gdfe_ros").rglob("*.py")})
"""Folders of the package."""
MOST = 15
"""Largest number of modules in a folder."""


_ROS = "rclpy sensor_msgs std_msgs geometry_msgs"


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("import gdfe_ros", "numpy scipy numba pydantic rclpy mcap"),
        ("from gdfe_ros import load_scene", _ROS),
        ("from gdfe_ros import Simulation", _ROS),
        ("from gdfe_ros.testing import make_env", _ROS),
        ("import gdfe_ros.testing.render", "viser"),  # pictures of an environment need no page
        ("import gdfe_ros.scene", "rclpy pandas pyvista matplotlib numba meshio trimesh"),
        ("from gdfe_ros import load_scene; load_scene('bend5')", "numba"),
        ("from gdfe_ros import Simulation, load_scene; Simulation(load_scene('bend5'))", "scipy.interpolate"),
        ("import gdfe_ros.live.page, gdfe_ros.commands.live", "numba gdfe_ros.simulation"),
        ("import gdfe_ros.live.page, gdfe_ros.commands.live, gdfe_ros.live.session", "rclpy rosbags"),
    ],
)
def test_what_is_not_needed_is_not_loaded(code: str, heavy: str) -> None:
    """A fresh process that imports a part of the package, or reads a scene, does not load modules that cost time."""
    done = run_python(f"{code}; import sys; print(*sys.modules)")
    loaded = set(done.stdout.split())
    assert "gdfe_ros" in loaded, done.stderr
    assert not loaded & set(heavy.split())


def test_public_names_are_listed_and_others_refused() -> None:
    """The public names are listed, and another name is refused with that list."""
    assert set(gdfe_ros.__all__) <= set(dir(gdfe_ros))
    with pytest.raises(AttributeError, match=r"no attribute 'solve'; it offers .*load_scene"):
        _ = gdfe_ros.solve


def test_the_share_directory_of_a_clone_is_the_tree() -> None:
    """In a clone, scenes and parameters are found beside the code."""
    assert (share_dir() / "config" / "sim.yaml").is_file()


def test_a_missing_share_directory_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code copied without its files raises an error that says how to install."""
    monkeypatch.setattr("gdfe_ros.installation.__file__", str(tmp_path / "gdfe_ros" / "installation.py"))
    with pytest.raises(GdfeError, match=r"share/gdfe_ros/package.xml.*make install"):
        share_dir.__wrapped__()


def _imports(path: Path) -> set[str]:
    """Return the modules of the package that a file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return found


def test_no_module_imports_itself_by_way_of_others() -> None:
    """The modules can be sorted so that each comes after those that it imports."""
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (ROOT / "gdfe_ros").rglob("*.py")
    }
    graph = {name: (_imports(path) & files.keys()) - {name} for name, path in files.items()}
    order = tuple(TopologicalSorter(graph).static_order())
    assert order.index("gdfe_ros.mesh.cells.faces") < order.index("gdfe_ros.simulation")


@pytest.mark.parametrize("folder", ROOMS, ids=lambda folder: str(folder.relative_to(ROOT)))
def test_a_room_is_small_and_without_circles(folder: Path) -> None:
    """A folder has at most 15 modules, and its modules and folders do not import each other in a circle."""
    modules, graph = [*folder.glob("*.py")], {}
    assert len(modules) <= MOST
    package = ".".join(folder.relative_to(ROOT).parts) + "."
    members = {path.relative_to(folder).with_suffix("").parts[0] for path in folder.rglob("*.py")} - {"__init__"}
    for path in folder.rglob("*.py"):
        member = path.relative_to(folder).with_suffix("").parts[0]
        inside = {name.removeprefix(package).partition(".")[0] for name in _imports(path) if name.startswith(package)}
        graph.setdefault(member, set()).update(inside & members - {member})
    assert {*TopologicalSorter(graph).static_order()} == members | {"__init__"}


@pytest.mark.parametrize(
    ("package", "heading"), [("gdfe_ros", "# Architecture"), ("gdfe_ros.solver", "## Packages of the solver")]
)
def test_rooms_have_an_order(package: str, heading: str) -> None:
    """Modules import only from their own row of a table of the architecture page, and from rows below."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition(f"{heading}\n")[2]
    table = [line.split("|")[1] for line in page.partition("\n## ")[0].splitlines() if line.startswith("| `")]
    rows = {name.removesuffix("/").removesuffix(".py"): k for k, row in enumerate(table) for name in _quoted(row)}
    house, wrong = ROOT.joinpath(*package.split(".")), []
    rooms = {path.relative_to(house).with_suffix("").parts[0] for path in house.rglob("*.py")}
    assert rows.keys() == rooms - {"__init__"}
    for path in house.rglob("*.py"):
        room = path.relative_to(house).with_suffix("").parts[0]
        for name in _imports(path):
            other = name.removeprefix(f"{package}.").partition(".")[0] if name.startswith(f"{package}.") else room
            if room != "__init__" and other in rows and rows[other] < rows[room]:
                wrong.append(f"{path.relative_to(house)} imports {name}")
    assert not wrong


def _quoted(text: str) -> list[str]:
    """Return the names between backquotes."""
    return text.split("`")[1::2]
