# SPDX-License-Identifier: Apache-2.0
"""Replays of the kept bags with machine code for another processor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_ELSEWHERE = {"NUMBA_CPU_NAME": "generic", "OPENBLAS_CORETYPE": "Prescott"}
"""A processor of 2004 without AVX and fused multiply-add, so that nearly every sum is rounded differently."""


@pytest.mark.torture
def test_every_bag_replays_elsewhere(kept_bags: dict[Path, float], tmp_path: Path) -> None:
    """Each bag replays for that processor, in its own process, within the factor that the README states."""
    environment = {**os.environ, **_ELSEWHERE, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    failed = {}
    for bag, factor in kept_bags.items():
        command = [sys.executable, "-m", "gdfe_ros.cli", "replay", str(bag), "--within", f"{factor:g}"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        print(done.stdout, done.stderr)
        if done.returncode != 0:
            failed[bag.name] = done.stdout[-300:]
    assert not failed
