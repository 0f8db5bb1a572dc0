# SPDX-License-Identifier: Apache-2.0
"""Time of a fit of modulus and viscosity to 430 samples of the measured beam without load, in two processes.

``python -m benchmarks.fit_time`` prints wall time, processor time of all processes, and the number of simulations.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage

RECORDED = Path(__file__).parents[1] / "test" / "data" / "measured" / "beam_0g.csv"
MATCH = """
time: t_s
compare:
  end: {mean: {face: x+}, columns: {z: [m1_up_mm, m2_up_mm, m3_up_mm]}, unit: mm, displacement: true}
shift_between: [-0.03, 0.03]
"""


def main() -> None:
    """Print the times."""
    with tempfile.TemporaryDirectory() as folder:
        match, began = Path(folder) / "match.yaml", time.perf_counter()
        match.write_text(MATCH)
        vary = ("materials.silicone.young=1e5..1e6", "dynamics.damping.viscosity=10..2000")
        given = ["fit", "silicone_beam", RECORDED, "--match", match, "--out", Path(folder) / "out", "--workers", "2"]
        varied = [part for each in vary for part in ("--vary", each)]
        command = [sys.executable, "-m", "gdfe_ros.cli", *map(str, given), *varied]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        wall, used = time.perf_counter() - began, getrusage(RUSAGE_CHILDREN)
    values, simulations = re.search(r"(\d+) values", done.stdout)[1], re.search(r"(\d+) simulations", done.stdout)[1]
    print(f"{values} values, {simulations} simulations: {wall:.0f} s, processor {used.ru_utime + used.ru_stime:.0f} s")


if __name__ == "__main__":
    main()
