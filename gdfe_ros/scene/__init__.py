# SPDX-License-Identifier: Apache-2.0
"""Scene files: YAML text is read into a validated scene."""

from __future__ import annotations

import gdfe_ros.scene.requirement  # noqa: F401 -- before all that imports pydantic
from gdfe_ros.scene.loader import load_scene, scene_from_text, scene_names
from gdfe_ros.scene.program import Keyframe, Program
from gdfe_ros.scene.scene import Scene

__all__ = ["Keyframe", "Program", "Scene", "load_scene", "scene_from_text", "scene_names"]
