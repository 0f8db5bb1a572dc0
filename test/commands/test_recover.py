# SPDX-License-Identifier: Apache-2.0
"""``gdfe recover`` on the command line; test/recording tests the recovery itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message
from std_msgs.msg import String

from gdfe_ros.cli import main
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.writer import BagWriter


def _cut_bag(path: Path) -> Path:
    """Write 100 messages and cut the file as a kill would."""
    with_topic = TopicInfo(name="/words", type="std_msgs/msg/String")
    writer = BagWriter(path, [with_topic])
    for number in range(100):
        writer.write("/words", serialize_message(String(data=str(number))), number)
        writer.flush()
    writer.close()
    (file,) = path.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (path / "metadata.yaml").unlink()
    return path


def test_a_cut_bag_is_recovered(tmp_path: Path, capsys: Any) -> None:
    """A cut bag is recovered into a second bag with exit status 0, and the loss is reported."""
    bag = _cut_bag(tmp_path / "run")
    assert main(["recover", str(bag)]) == 0
    shown = capsys.readouterr().out
    found = BagReader(tmp_path / "run_recovered")
    assert 20 < found.counts["/words"] < 100
    assert f"{len(found)} messages in" in shown
    assert "run_0.mcap was cut off" in shown


def test_nothing_to_recover(tmp_path: Path, capsys: Any) -> None:
    """An empty directory gives exit status 2 and one clear line."""
    assert main(["recover", str(tmp_path)]) == 2
    assert "there is no MCAP file" in capsys.readouterr().err
