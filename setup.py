# SPDX-License-Identifier: Apache-2.0
"""One build description for pip and colcon (ament_python); package.xml holds version and description."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "gdfe_ros"
HERE = Path(__file__).resolve().parent
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()


def share_files() -> list[tuple[str, list[str]]]:
    """Pair every directory under config/ and launch/ with its files, for ``share/gdfe_ros``."""
    found: dict[str, list[str]] = defaultdict(list)
    for root in ("config", "launch"):
        for path in sorted((HERE / root).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                relative = path.relative_to(HERE)
                found[f"share/{NAME}/{relative.parent}"].append(str(relative))
    return sorted(found.items())


RECORDING = ["mcap>=1.6", "lz4>=4.3", "zstandard>=0.22", "rosbags>=0.11"]
# Kinematics and Newton-Euler of arms. Its name on PyPI is pin; apt has ros-jazzy-pinocchio.
# trimesh and pycollada read the shapes of links.
ARM = ["pin>=3.0", "trimesh>=4.0", "pycollada>=0.8"]
EXTRAS = {
    # ROS 2 Jazzy from wheels. Never in install_requires: with ROS from apt they would be fetched twice.
    "ros": [
        "ros-jazzy-rclpy==7.1.6",
        "ros-jazzy-rmw-fastrtps-cpp==8.4.3",
        "ros-jazzy-common-interfaces==5.3.6",
        *RECORDING,  # the node imports its recorder
    ],
    "mcap": [*RECORDING],
    "arm": [*ARM],
    # Robots of the scenes pick_ur5e (13 MB) and pick_panda (130 MB): URDFs and meshes
    "ur5e": [*ARM, "airo-models>=0.0.12"],
    "panda": [*ARM, "example-robot-data>=6.0"],
    "fast": ["threadpoolctl>=3.2"],
    "mesh": ["meshio>=5.3", "trimesh>=4.0"],
    # gmsh (GPL) runs in a process of its own; pytetwild needs pyvista to be imported.
    "cad": ["gmsh>=4.13", "meshio>=5.3", "pytetwild>=0.4.2", "pyvista>=0.45", "trimesh>=4.0"],
    "plot": ["matplotlib>=3.8", "plotly>=5.20", "pillow>=10.0"],
    "sweep": ["distributed>=2024.8", "pyarrow>=15.0"],
    "video": ["av>=14.0"],
    "live": ["viser>=1.1,<2"],
    "control": ["quadprog>=0.1.12"],
    "gym": ["gymnasium>=1.0", "pyvista>=0.45"],
    "bench": [
        "felupe>=11.3",
        "tensortrax>=0.29",
        "pypardiso>=0.4.7",
        "mujoco>=4.0",
    ],
    "docs": ["mkdocs>=1.6", "latex2mathml>=3.77"],
    "test": [
        "pytest>=8.0",
        "pytest-xdist>=3.5",
        "hypothesis>=6.100",
        "ruff==0.17.5",
        "build>=1.2",
        "mcap-ros2-support>=0.6",
        "catkin-pkg>=1.0",
        "docutils>=0.20",
        "selenium>=4.20",
        "av>=14.0",
        "viser>=1.1,<2",
        "gymnasium>=1.0",
        "quadprog>=0.1.12",
        "pin>=3.0",
        "pycollada>=0.8",
        "airo-models>=0.0.12",
        "example-robot-data>=6.0",
        "rtb-data>=2.0",
        "mujoco>=4.0",
        "felupe>=11.3",
        "gmsh>=4.13",
        "pytetwild>=0.4.2",
        "pyvista>=0.45",
        "threadpoolctl>=3.2",
    ],
}

setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    license_files=["LICENSE"],
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={f"{NAME}.analysis.report": ["page/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *share_files(),
    ],
    python_requires=">=3.10",
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "numba>=0.58",
        "pydantic>=2.6",
        "pyyaml>=6.0",
        "rich>=13.0",
    ],
    extras_require=EXTRAS,
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "gdfe = gdfe_ros.entry:gdfe",
            "sim_node = gdfe_ros.entry:sim_node",
            "carrying_arm = gdfe_ros.entry:carrying_arm",
            "tip_tracking = gdfe_ros.entry:tip_tracking",
        ]
    },
)
