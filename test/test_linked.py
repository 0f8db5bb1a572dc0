# SPDX-License-Identifier: Apache-2.0
"""Kernels that call each other by their addresses."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SOURCE = """
from gdfe_ros.compiled import internal, kernel

@internal
def long_sum(values):
    total = 0.0
{lines}
    return {result}

@kernel
def twice(values):
    return 2.0 * long_sum(values)
"""
USE = """
import numpy as np
import kernels
print(kernels.twice(np.arange(8.0)), sum(kernels.twice.stats.cache_hits.values()))
"""
LINE = "    if values[{0}] + {1} >= {0}:\n        total += values[{2}] / {3}"
LINES = "\n".join(LINE.format(i % 8, i, 3 * i % 8, i + 1) for i in range(80))


def _run(folder: Path) -> tuple[str, int, int]:
    """Call the kernel in a new process; return its value, hits of the cache, and the size of the caller's file."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(folder)}
    done = subprocess.run([sys.executable, "-c", USE], env=environment, capture_output=True, text=True, check=True)
    value, hits = done.stdout.split()
    sizes = {each.name.partition("-")[0]: each.stat().st_size for each in (folder / "cache").rglob("*.nbc")}
    return value, int(hits), sizes["kernels.twice"]


def test_a_caller_follows_a_changed_kernel(tmp_path: Path) -> None:
    """A caller from the cache calls the new version of an edited kernel, and is compiled anew for another type."""
    source = tmp_path / "kernels.py"
    source.write_text(SOURCE.format(lines=LINES, result="total"))
    first, hits, size = _run(tmp_path)
    assert hits == 0
    assert float(first) > 0.0
    assert size < 30_000, "the caller contains the called kernel"
    assert _run(tmp_path)[:2] == (first, 1)
    source.write_text(SOURCE.format(lines=LINES, result="2.0 * total"))
    assert float(_run(tmp_path)[0]) == 2.0 * float(first)
    source.write_text(SOURCE.format(lines=LINES, result="3 * int(total)"))
    assert float(_run(tmp_path)[0]) == 6.0 * int(float(first) / 2.0)


FOREIGN = """
import numpy as np
from numba import njit
import kernels

@njit(cache=True)
def half(values):
    return 0.5 * kernels.long_sum(values)
"""


def test_a_function_of_a_user_calls_kernels_in_each_process(tmp_path: Path) -> None:
    """Numba's own cache, which knows no symbols of kernels, stores no function that calls one."""
    (tmp_path / "kernels.py").write_text(SOURCE.format(lines=LINES, result="total"))
    (tmp_path / "foreign.py").write_text(FOREIGN)
    use = "import numpy as np, foreign; print(foreign.half(np.arange(8.0)))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", use], env=environment, capture_output=True, text=True, check=True)
        assert "Cannot cache compiled function" in done.stderr
        assert float(done.stdout) > 0.0
