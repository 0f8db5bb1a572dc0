# SPDX-License-Identifier: Apache-2.0
"""Worker processes have one thread each, and this process's environment is unchanged afterwards."""

from __future__ import annotations

import os

import pytest

from gdfe_ros.workers import THREAD_COUNTS, open_workers


def test_workers_are_told_to_use_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two fresh workers have one thread in their environment, and this process's environment is unchanged."""
    monkeypatch.setenv("NUMBA_NUM_THREADS", "7")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with open_workers(2) as executor:
        assert list(executor.map(os.getenv, THREAD_COUNTS)) == ["1"] * len(THREAD_COUNTS)
    assert os.environ["NUMBA_NUM_THREADS"] == "7"
    assert "OMP_NUM_THREADS" not in os.environ
