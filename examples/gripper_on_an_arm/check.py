# SPDX-License-Identifier: Apache-2.0
"""Check that the arm carries the box: it is lifted, and the table carries nothing."""

from gdfe_ros.analysis.bag_run import BagRun

run = BagRun("run/bag")
height = run.last_places("bodies/*/pose")["part"][2]
force = run.last_total_forces()["table"][2]
print(f"the box is lifted by {1e3 * height:.1f} mm, the table carries {abs(force):.3f} N")
assert height > 0.02
assert force == 0.0
