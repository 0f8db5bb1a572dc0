# SPDX-License-Identifier: Apache-2.0
"""The extra of this package that installs a missing module, for errors that name it."""

from __future__ import annotations

from importlib.util import find_spec

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
"""Dict from package with robots of scenes that are shipped to the extra that installs it."""
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
    """Return one line: the missing module and what installs it, and all else that a command of ``gdfe`` misses.

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
