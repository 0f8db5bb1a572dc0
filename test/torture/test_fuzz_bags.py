# SPDX-License-Identifier: Apache-2.0
"""Fuzzing of the bag reader: damaged files are refused by name or read without the damage, and never crash."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gdfe_ros.errors import GdfeError
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.reader import BagReader
from gdfe_ros.recording.recovery import recover
from gdfe_ros.recording.writer import BagWriter
from test.torture.examples import examples

pytestmark = pytest.mark.usefixtures("limited")
QUICK = examples(80)
TOPIC = TopicInfo(name="/text", type="std_msgs/msg/String")
COUNT = 50


def _payload(number: int) -> bytes:
    text = f"message {number}".encode() + b"\0"
    return b"\0\1\0\0" + len(text).to_bytes(4, "little") + text


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the bytes of a valid MCAP file with 50 messages."""
    path = tmp_path_factory.mktemp("bag") / "sound"
    with closing(BagWriter(path, topics=[TOPIC])) as writer:
        for number in range(COUNT):
            writer.write(TOPIC.name, _payload(number), number)
    return next(path.glob("*.mcap")).read_bytes()


def _outcome(action: Callable[[], int]) -> tuple[int, str]:
    """Return the count of messages and no text, or the text of the refusal."""
    try:
        return action(), ""
    except GdfeError as error:
        return 0, str(error)


def _check(path: Path, data: bytes, output: Path) -> None:
    path.write_bytes(data)
    count, refusal = _outcome(lambda: sum(1 for _ in BagReader(path).messages()))
    assert count <= COUNT
    assert not refusal or path.name in refusal
    count, refusal = _outcome(lambda: recover(path, output).total)
    assert count <= COUNT


@given(st.data())
@QUICK
def test_flipped_bytes(bag: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """A file with a few bytes overwritten is read or refused by name."""
    damaged = bytearray(bag)
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(bag) - 1))] = data.draw(st.integers(0, 255))
    folder = tmp_path_factory.mktemp("flipped")
    _check(folder / "bag.mcap", bytes(damaged), folder / "out")


@given(st.data())
@QUICK
def test_cut_files(bag: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """A file cut off anywhere is read or refused by name."""
    folder = tmp_path_factory.mktemp("cut")
    _check(folder / "bag.mcap", bag[: data.draw(st.integers(0, len(bag)))], folder / "out")


@given(st.binary(max_size=300))
@QUICK
def test_any_bytes(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    """A file of random bytes is read as a bag or refused by name."""
    folder = tmp_path_factory.mktemp("any")
    _check(folder / "bag.mcap", content, folder / "out")
