# SPDX-License-Identifier: Apache-2.0
"""Commands that read a bag, on damaged ones: one clear line and exit status 2, never a traceback."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from gdfe_ros.cli import main
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.reader import BagReader

COMMANDS = {
    "replay": lambda bag: ["replay", bag],
    "compare": lambda bag: ["compare", bag, bag],
    "export": lambda bag: ["export", bag, "--out", f"{bag}.npz"],
    "report": lambda bag: ["report", bag, "--out", f"{bag}.html"],
}


def _edit_metadata(change: Callable[[str], str]) -> Callable[[Path], None]:
    def damage(bag: Path) -> None:
        file = bag / "metadata.yaml"
        file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")

    return damage


def _without(key: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        data = yaml.safe_load(text)
        del data["rosbag2_bagfile_information"][key]
        return yaml.safe_dump(data)

    return change


def _damage_schema(bag: Path) -> None:
    """Damage a message definition that the file's index repeats."""
    (file,) = bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[content.rindex(b"MSG: std_msgs/Header") + 5] ^= 0x80
    file.write_bytes(content)


def _damage_scene(bag: Path) -> None:
    """Change a digit in the scene, which only its checksum detects."""
    (file,) = bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    place = content.index(b"young: ") + 7
    content[place] = ord("1") + (content[place] == ord("1"))
    file.write_bytes(content)


DAMAGES = {
    "cut in the middle": _edit_metadata(lambda text: text[: len(text) // 2]),
    "empty": _edit_metadata(lambda text: ""),
    "no YAML": _edit_metadata(lambda text: "{" + text),
    "a list": _edit_metadata(lambda text: "- 1\n- 2\n"),
    "no storage_identifier": _edit_metadata(_without("storage_identifier")),
    "no files": _edit_metadata(_without("relative_file_paths")),
    "binary": lambda bag: (bag / "metadata.yaml").write_bytes(b"\xff\xfe\0\x80"),
    "schema": _damage_schema,
    "scene": _damage_scene,
}


@pytest.fixture
def bag(tmp_path: Path, kept_bags: dict[Path, float]) -> Path:
    """Return a copy of a recorded bag."""
    source = next(path for path in kept_bags if path.name == "bend5")
    return shutil.copytree(source, tmp_path / "bend5")


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_bag_is_refused_in_one_line(bag: Path, command: str, damage: str, capsys: Any) -> None:
    """A damaged metadata.yaml, schema or scene gives exit status 2 and one line with file and remedy."""
    DAMAGES[damage](bag)
    assert main(COMMANDS[command](str(bag))) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith(f"gdfe {command}: ")
    assert "bend5" in line
    assert "gdfe recover" in line
    if damage in ("schema", "scene"):
        assert main(["recover", str(bag), "--out", f"{bag}_new"]) == 0
        assert main(["compare", f"{bag}_new", f"{bag}_new"]) == 0


def test_no_flipped_byte_of_the_metadata_ends_in_a_traceback(bag: Path) -> None:
    """With every 149th byte of metadata.yaml changed, the bag is read or refused by name."""
    file = bag / "metadata.yaml"
    sound, refusals = file.read_bytes(), []
    for place in range(0, len(sound), 149):
        file.write_bytes(sound[:place] + bytes([sound[place] ^ 0x11]) + sound[place + 1 :])
        try:
            assert len(BagReader(bag)) > 0
        except RecordingError as error:
            refusals.append(str(error))
    assert refusals
    assert all("bend5" in refusal for refusal in refusals)
