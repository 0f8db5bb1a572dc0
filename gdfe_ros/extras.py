# SPDX-License-Identifier: Apache-2.0
"""The extra of this package that installs a missing module, for errors that name it."""

from __future__ import annotations

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


def extra_of(module: str) -> str | None:
    """Return the extra that installs a top-level module; None if no extra does."""
    if module in _ROS or module.endswith(("_msgs", "_srvs", "_interfaces")) or module.startswith("rosidl"):
        return "ros"
    return next((extra for extra, modules in _EXTRAS.items() if module in modules), None)


def robots_extra(package: str) -> str | None:
    """Return the extra that installs a package with robots; None if no extra does."""
    return _ROBOTS.get(package)


def remedy(error: ModuleNotFoundError) -> str | None:
    """Return one line: the missing module and the command that installs it; None if no extra has the module."""
    module = (error.name or "").partition(".")[0]
    extra = extra_of(module)
    if extra is None:
        return None
    text = f"needs {module}, which is not installed; remedy: pip install 'gdfe_ros[{extra}]'"
    return f"{text}, or source your ROS 2 installation" if extra == "ros" else text
