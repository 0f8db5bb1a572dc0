# SPDX-License-Identifier: Apache-2.0
"""Step records keep all that a replay needs."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gdfe_ros.constraints import Pose
from gdfe_ros.errors import RecordingError
from gdfe_ros.recording.step import ENERGIES, Begin, StepRecord

_NUMBER = st.floats(allow_nan=False, allow_infinity=False)
_TRIPLE = st.tuples(_NUMBER, _NUMBER, _NUMBER)


@given(time=_NUMBER, translation=_TRIPLE, rotation=_TRIPLE, command=_NUMBER)
def test_every_double_survives(time: float, translation: tuple, rotation: tuple, command: float) -> None:
    """Any numbers in a record are read back bit for bit."""
    record = StepRecord(
        step=7,
        begin=Begin.LOADED,
        time=time,
        dt=0.01,
        stamp=5,
        handles={"tip": Pose(translation, rotation)},
        actuators={"flexor": command},
        skipped={"solve": 1},
        message="so so",
    )
    assert StepRecord.from_json(record.to_json()) == record


def test_an_unknown_error_survives() -> None:
    """An infinite error estimate, which JSON has not, is read back."""
    record = StepRecord(step=0, begin=Begin.REST, time=0.0, dt=0.0, stamp=0, error_estimate=math.inf)
    assert StepRecord.from_json(record.to_json()) == record


@pytest.mark.parametrize("text", ["", "{}", "[1]", "null", '{"format": 99}', '{"format": 1, "step": 1}'])
def test_other_texts_are_refused(text: str) -> None:
    """A text that is no record, or of another format, is refused with the text."""
    with pytest.raises(RecordingError, match="cannot be read"):
        StepRecord.from_json(text)


def test_the_text_is_plain_json() -> None:
    """Any JSON parser can read a record, with six numbers for each handle."""
    text = StepRecord(step=1, begin=Begin.LAST, time=0.5, dt=0.5, stamp=0, handles={"tip": Pose((1, 2, 3))}).to_json()
    assert json.loads(text)["handles"] == {"tip": [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]}
    assert text.startswith('{"format": 1, "step": 1, "begin": "last"')


@pytest.mark.parametrize("key", ["stamp", "error_estimate", "cut_after"])
def test_a_record_lacks_nothing(key: str) -> None:
    """A record without a stamp, an error estimate or the end of its solve, as before version 0.1.0, is refused."""
    record = StepRecord(step=1, begin=Begin.LAST, time=0.5, dt=0.5, stamp=1_795_000_000_123_456_789)
    assert StepRecord.from_json(record.to_json()) == record
    entries = json.loads(record.to_json())
    del entries[key]
    with pytest.raises(RecordingError, match=key):
        StepRecord.from_json(json.dumps(entries))


def test_energies_are_told_of_bodies_in_motion_only() -> None:
    """Energies are written for bodies in motion only; without them the text is as before."""
    still = StepRecord(step=1, begin=Begin.LAST, time=0.5, dt=0.5, stamp=0)
    assert "energies" not in json.loads(still.to_json())
    assert StepRecord.from_json(still.to_json()) == still
    energies = {**dict.fromkeys(ENERGIES, 0.1), "work": -1e-300}
    moving = StepRecord(step=1, begin=Begin.LAST, time=0.5, dt=0.5, stamp=0, energies=energies)
    assert StepRecord.from_json(moving.to_json()) == moving
