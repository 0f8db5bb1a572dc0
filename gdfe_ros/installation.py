# SPDX-License-Identifier: Apache-2.0
"""The installed package: its directory of data files, and the extras that install missing packages."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from gdfe_ros.errors import GdfeError

_EXTRAS: dict[str, tuple[str, ...]] = {
    "mcap": ("mcap", "lz4", "zstandard", "rosbags"),
    "arm": ("pinocchio", "collada"),
    "mesh": ("meshio", "trimesh"),
    "cad": ("gmsh", "pytetwild"),
    "gym": ("gymnasium", "pyvista"),
    "plot": ("matplotlib", "plotly", "PIL"),
    "sweep": ("distributed", "dask", "pyarrow"),
    "video": ("av",),
    "live": ("viser",),
    "control": ("quadprog",),
    "fast": ("threadpoolctl",),
}
_ROBOTS = {"airo-models": "ur5e", "example-robot-data": "panda"}
"""Dict from a package whose robots occur in shipped scenes to the extra that installs the package."""
_ROS = ("rclpy", "rpyutils", "builtin_interfaces", "action_msgs", "rcl_interfaces", "unique_identifier_msgs")

_TOGETHER: dict[str, tuple[str, ...]] = {"demo": ("ros", "mcap", "plot"), "report": ("mcap", "plot")}
"""The extras that a command of ``gdfe`` needs, if it needs several."""


def extra_of(module: str) -> str | None:
    """Return the extra that installs a top-level module; None if no extra does."""
    if module in _ROS or module.endswith(("_msgs", "_srvs", "_interfaces")) or module.startswith("rosidl"):
        return "ros"
    return next((extra for extra, modules in _EXTRAS.items() if module in modules), None)


def robots_extra(package: str) -> str | None:
    """Return the extra that installs a package with robots; None if no extra does."""
    return _ROBOTS.get(package)


def remedy(error: ModuleNotFoundError, *, command: str = "") -> str | None:
    """Return one line that names the missing module, and all missing extras that ``command`` needs.

    None if no extra has the module.
    """
    module = (error.name or "").partition(".")[0]
    extra = extra_of(module)
    if extra is None:
        return None
    missing = {each for each in _TOGETHER.get(command, ()) if not is_installed(each)} | {extra}
    extras = ",".join(sorted(missing, key=lambda each: (each != "ros", each)))
    text = f"needs {module}, which is not installed; remedy: pip install 'gdfe_ros[{extras}]'"
    return f"{text}, or source your ROS 2 installation" if extra == "ros" else text


def is_installed(extra: str) -> bool:
    """Return whether the modules of an extra can be imported."""
    return all(find_spec(module) is not None for module in (_EXTRAS | {"ros": ("rclpy",)})[extra])


_PACKAGE = "gdfe_ros"


@lru_cache(maxsize=1)
def share_dir() -> Path:
    """Return the directory that contains ``package.xml``, ``config/`` and ``launch/``.

    It depends only on the location of this module, so that code and scenes always have the same version. For a clone,
    ``pip install -e`` and ``colcon build --symlink-install``, the directory is the source tree. Otherwise it is
    ``<prefix>/share/gdfe_ros``, with the prefix of the installation (colcon, apt, pip, venv).

    Returns:
        Absolute path of the directory.

    Raises:
        GdfeError: the package was copied without the files of its share directory.
    """
    module = Path(__file__).resolve()
    prefixes = module.parents[1:]
    for directory in (prefixes[0], *(prefix / "share" / _PACKAGE for prefix in prefixes)):
        if (directory / "package.xml").is_file():
            return directory
    raise GdfeError(
        f"the share directory of {_PACKAGE} was not found: no share/{_PACKAGE}/package.xml in any directory "
        f"above {module}. Install the package with `make install`, `pip install .` or `colcon build`."
    )
