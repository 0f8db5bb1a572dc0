# SPDX-License-Identifier: Apache-2.0
"""Joints move toward their goals within their limits, and follow slow goals exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gdfe_ros.arms.description import UrdfLimits
from gdfe_ros.arms.joint_limits import JointLimits, JointMotion

STEP = 0.005


def limits(velocity: float = 2.0, acceleration: float = 10.0) -> JointLimits:
    """Return the limits of one joint."""
    return JointLimits([UrdfLimits(lower=-3.0, upper=3.0, velocity=velocity, acceleration=acceleration)])


def test_a_jump_is_a_trapezoid_of_velocity() -> None:
    """A far goal is reached in the time of the trapezoidal profile, d/v + v/a, without overshoot."""
    own, motion, times = limits(), JointMotion.at([0.0])._replace(goals=np.array([2.0])), 0
    while not motion.arrived:
        motion, _ = own.advance(motion, np.array([2.0]), STEP)
        times += 1
        assert abs(motion.velocities[0]) <= 2.0 + 1e-12
        assert abs(motion.accelerations[0]) <= 10.0 + 1e-6 or motion.positions[0] == 2.0
        assert motion.positions[0] <= 2.0
    assert times * STEP == pytest.approx(2.0 / 2.0 + 2.0 / 10.0, abs=5 * STEP)


def test_a_goal_that_moves_smoothly_is_followed_exactly() -> None:
    """A sine within the limits is followed without lag, and no limit is reported."""
    own, motion = limits(), JointMotion.at([0.0])
    for k in range(1, 2000):
        goal = 0.3 * (1.0 - np.cos(3.0 * k * STEP))
        motion, cut = own.advance(motion, np.array([goal]), STEP)
        assert motion.positions[0] == goal
        assert not cut.velocity[0]
        assert not cut.acceleration[0]


def test_cuts_are_told() -> None:
    """The active limit is reported: first the acceleration, then the velocity."""
    own, motion, told = limits(), JointMotion.at([0.0]), []
    for _ in range(100):
        motion, cut = own.advance(motion, np.array([2.5]), STEP)
        told.append((bool(cut.velocity[0]), bool(cut.acceleration[0])))
    assert told[0] == (False, True)
    assert told[-1] == (True, False)


def test_without_time_joints_are_at_their_goals() -> None:
    """In a step of zero duration, joints jump to their goals."""
    motion, cut = limits().advance(JointMotion.at([0.0]), np.array([1.0]), 0.0)
    assert motion.arrived
    assert motion.positions[0] == 1.0
    assert not cut.velocity[0]


@settings(max_examples=60, deadline=None)
@given(
    goals=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=8),
    step=st.floats(1e-3, 0.5),
    fast=st.floats(0.1, 10.0),
    hard=st.floats(0.1, 100.0),
)
def test_any_goals_keep_the_limits(goals: list[float], step: float, fast: float, hard: float) -> None:
    """For any goals, velocity and acceleration stay within their limits."""
    own, motion = limits(fast, hard), JointMotion.at([0.0])
    for goal in goals:
        for _ in range(20):
            motion, _ = own.advance(motion, np.array([goal]), step)
            assert abs(motion.velocities[0]) <= fast * (1.0 + 1e-9)
            assert -3.0 <= motion.positions[0] <= 3.0
            assert abs(motion.accelerations[0]) <= hard * (1.0 + 1e-6)


@settings(max_examples=60, deadline=None)
@given(
    goal=st.floats(-3.0, 3.0),
    steps=st.lists(st.floats(1e-4, 0.1), min_size=1, max_size=8),
    hard=st.floats(0.1, 100.0),
)
def test_any_steps_keep_the_limit_and_the_goal(goal: float, steps: list[float], hard: float) -> None:
    """For steps of any lengths, the acceleration stays within its limit, and the joint does not pass its goal."""
    own, motion = limits(10.0, hard), JointMotion.at([0.0])._replace(goals=np.array([goal]))
    for step in 40 * steps:
        motion, _ = own.advance(motion, np.array([goal]), step)
        assert abs(motion.accelerations[0]) <= hard * (1.0 + 1e-6)
        assert min(0.0, goal) - 1e-12 <= motion.positions[0] <= max(0.0, goal) + 1e-12


def test_braking_is_reported() -> None:
    """A joint that brakes is slower than its goal and its largest velocity allow because of its acceleration."""
    own, motion, braking = limits(), JointMotion.at([0.0])._replace(goals=np.array([1.0])), 0
    while not motion.arrived:
        before = motion.velocities[0]
        motion, cut = own.advance(motion, np.array([1.0]), STEP)
        braking += before == pytest.approx(2.0) and motion.velocities[0] < before and bool(cut.acceleration[0])
    assert braking == 1
