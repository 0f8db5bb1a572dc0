# SPDX-License-Identifier: Apache-2.0
"""A controller that closes soft fingers and holds an object with a wanted force, measured at the fingertips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gdfe_ros.scene.program import Program

BAND = 0.01
"""The commands stay constant if the error of the force, divided by the wanted force, is below this."""


def force_limit(strain: float, *, young: float, area: float) -> float:
    """Return the force [N] of a finger that strains a soft object by at most ``strain`` below the fingertip.

    Args:
        strain: largest allowed strain of the object.
        young: Young's modulus of the object [Pa].
        area: area of a fingertip's contact [m^2].
    """
    return strain * young * area


class SoftGrip:
    """Controller of the actuators of fingers that close from two sides. Needs no ROS.

    Each finger closes at a constant rate until its fingertip feels the object, and waits there for the others. Then all
    fingers are controlled by one quantity g: finger i has the command c_i + s_i g, where c_i is its command at the
    first contact, and s_i its fraction of the force. The integral law

        dg/dt = gain (goal - force),   |dg/dt| <= rate

    needs no model of the finger or of the object. Within `BAND` of the goal, g stays, and the hand comes to rest. The
    force is that of one side: half of the sum of all fingertips.

    Args:
        fractions: dict from actuator to its fraction s_i; those of each side have the same sum.
        rate: largest rate of a command, in its unit per second.
        gain: gain, in the command's unit per newton and second.
        low: command of an open finger.
        high: largest command.
        threshold: force [N] above which a fingertip feels the object.

    Attributes:
        commands: dict from actuator to its present command.
    """

    def __init__(
        self,
        fractions: Mapping[str, float],
        *,
        rate: float,
        gain: float,
        low: float,
        high: float,
        threshold: float = 0.02,
    ) -> None:
        if not (rate > 0.0 and gain > 0.0 and low < high and threshold > 0.0):
            raise ValueError(f"rate {rate}, gain {gain}, range {low} to {high}, threshold {threshold} N; allowed: > 0")
        self._fractions, self._rate, self._gain = dict(fractions), rate, gain
        self._low, self._high, self._threshold = low, high, threshold
        self.commands = dict.fromkeys(self._fractions, 0.0)
        self._touched: dict[str, float] = {}
        self._further = 0.0

    def hold(self, forces: Mapping[str, float], goal: float, dt: float) -> dict[str, float]:
        """Return the commands of the next step of ``dt`` [s] that close the fingers, or hold with a force.

        Args:
            forces: dict from actuator to the measured force of its fingertip [N].
            goal: wanted force of one side [N].
            dt: duration of the step [s].
        """
        most = self._rate * dt
        for name in self._fractions.keys() - self._touched.keys():
            if forces[name] > self._threshold:
                self._touched[name] = self.commands[name]
            else:
                self.commands[name] = min(self.commands[name] + most, self._high)
        if len(self._touched) == len(self._fractions):
            missing = goal - 0.5 * sum(forces.values())
            change = self._gain * missing * dt if abs(missing) > BAND * goal else 0.0
            self._further += min(max(change, -most), most)
            for name, start in self._touched.items():
                self.commands[name] = min(max(start + self._fractions[name] * self._further, self._low), self._high)
        return dict(self.commands)

    def release(self, dt: float) -> dict[str, float]:
        """Return the commands of the next step of ``dt`` [s] that open the fingers."""
        self._touched, self._further = {}, 0.0
        for name, value in self.commands.items():
            self.commands[name] = max(value - 2.0 * self._rate * dt, min(value, self._low))
        return dict(self.commands)


class GripSchedule:
    """Controller that closes and opens a grip at the times of a scene's program, with a wanted force. Needs no ROS.

    Args:
        program: program of the scene; while the largest command of its actuators is above 0 and does not fall, the
            grip closes or holds.
        grip: controller of the fingers.
        forces: wanted force of one side [N], for each time that the grip closes.
        dt: duration of a step [s].
    """

    def __init__(self, program: Program, grip: SoftGrip, *, forces: Sequence[float], dt: float) -> None:
        self._program, self._grip, self._forces, self._dt = program, grip, list(forces), dt
        self._count, self._closed = 0, False

    def commands(self, time: float, felt: Mapping[str, float]) -> dict[str, float]:
        """Return the commands of the step that begins at a ``time`` [s], from the fingertips' forces [N]."""
        now, then = (max(self._program.actuator_values(at).values()) for at in (time, time + self._dt))
        closes = then >= now and then > 0.0
        self._count += closes and not self._closed
        self._closed = closes
        if closes:
            return self._grip.hold(felt, self._forces[self._count - 1], self._dt)
        return self._grip.release(self._dt)
