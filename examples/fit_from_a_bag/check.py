# SPDX-License-Identifier: Apache-2.0
"""Compare the fitted modulus with the true one."""

import json
from pathlib import Path

fit = json.loads(Path("fit/fit.json").read_text())
value = fit["parameters"]["materials.silicone.young"]["value"]
print(f"fitted {value:.6g} Pa, true 800000 Pa")
assert abs(value / 8.0e5 - 1.0) < 1e-3
