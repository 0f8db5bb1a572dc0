# SPDX-License-Identifier: Apache-2.0
"""Three commands go from a STEP file with three blind holes to a moving picture."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from docs.scripts.cad_part import COMMANDS, Part, timed
from docs.scripts.drawing import write_step
from gdfe_ros.scene import load_scene


@pytest.mark.slow
def test_three_commands_from_a_step_file_to_a_moving_picture(tmp_path: Path) -> None:
    """The commands of the tutorial write a scene with a chamber for each hole, and an animation of its run."""
    write_step(Part(), tmp_path / "part.step")
    assert len(timed(COMMANDS, tmp_path)) == 3
    assert [chamber.name for chamber in load_scene(tmp_path / "part.yaml").actuators] == ["air_0", "air_1", "air_2"]
    with Image.open(tmp_path / "part.gif") as film:
        assert film.n_frames == 11
