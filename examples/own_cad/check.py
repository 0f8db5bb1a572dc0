# SPDX-License-Identifier: Apache-2.0
"""Check that the chamber is under pressure and that the finger bends towards its thick side."""

import json

import numpy as np

with np.load("finger.npz") as result:
    pressure, tip = result["actuator_air_0"][2], result["probe_tip"]
    assert json.loads(str(result["meta"]))["converged"]
print(f"{pressure:.0f} Pa move the far end to {1e3 * tip} mm")
assert pressure > 1000.0
assert tip[2] < -1e-5
