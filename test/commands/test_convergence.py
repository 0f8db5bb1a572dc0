# SPDX-License-Identifier: Apache-2.0
"""Steps that did not converge are named."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gdfe_ros.commands.waiting import MOST_LINES, convergence, print_failures


def test_steps_that_did_not_converge_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    """Of five failures in ten steps, their number is printed, and step, time and reason of the first ones."""
    steps = [SimpleNamespace(converged=k % 2 == 0, time=0.1 * k, message=f"[reason {k}]") for k in range(10)]
    assert convergence(steps) == "no: 5 of 10 steps"
    print_failures(steps, first=0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "step 1, t = 0.1 s, did not converge: [reason 1]"
    assert lines[-1] == f"and {5 - MOST_LINES} more"


def test_nothing_is_said_of_steps_that_converged(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is printed if all steps converged."""
    steps = [SimpleNamespace(converged=True, time=0.0, message="")]
    assert convergence(steps) == "yes"
    print_failures(steps)
    assert capsys.readouterr().err == ""
