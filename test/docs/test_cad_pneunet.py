# SPDX-License-Identifier: Apache-2.0
"""The PneuNet finger: it curls more with more pressure, and the sheet of paper keeps the length of its base."""

from __future__ import annotations

import numpy as np
import pytest

from docs.scripts.cad_pneunet import MODELS, curls


@pytest.mark.slow
def test_the_finger_curls_and_the_paper_keeps_its_length() -> None:
    """The angle rises to more than 70 degrees; the base changes its length by 0.1 mm with paper, by more without."""
    with_paper, without = (curls(given) for given in MODELS.values())
    for found in (with_paper, without):
        assert np.diff(found[:, 0]).min() > 0.0
    assert with_paper[-1, 0] > 70.0
    assert abs(with_paper[-1, 1]) < 0.1 < 1.0 < abs(without[-1, 1])
