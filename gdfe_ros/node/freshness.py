# SPDX-License-Identifier: Apache-2.0
"""Checks of command stamps: not ahead, not too old, and not before the last one."""

from __future__ import annotations

from collections.abc import Collection

from builtin_interfaces.msg import Time

from gdfe_ros.node.refusals import Reason, Refusal


class Freshness:
    """Checks the stamp of a command against the clock and against the last stamp for the same handle or actuator.

    A stamp of zero means "now" and is always accepted. If the clock goes back, as at the start of a replayed bag, the
    stored stamps are dropped.
    """

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self._now = 0

    def check(self, sources: Collection[str], stamp: Time, *, now: int, max_age: float, max_lead: float) -> None:
        """Check a stamp and store it.

        Args:
            sources: topic and name of each commanded item; each has a last stamp of its own.
            stamp: stamp of the command.
            now: time on the clock of the stamps [ns].
            max_age: largest age of a command [s]; 0: no limit.
            max_lead: largest time by which a stamp may be ahead of ``now`` [s].

        Raises:
            Refusal: the stamp is ahead, too old, or before the last accepted one.
        """
        if now < self._now:
            self.reset()
        self._now = now
        moment = stamp.sec * 10**9 + stamp.nanosec
        if moment == 0:
            return
        age = (now - moment) * 1e-9
        if -age > max_lead:
            raise Refusal(
                Reason.AHEAD,
                f"its stamp {moment * 1e-9:.9f} s is {-age:.3f} s ahead of the node's clock, {now * 1e-9:.9f} s; "
                f"command_max_lead is {max_lead:g} s: do both use the same clock (use_sim_time)?",
            )
        if max_age and age > max_age:
            raise Refusal(
                Reason.STALE,
                f"its stamp {moment * 1e-9:.9f} s is {age:.3f} s old; command_max_age is {max_age:g} s",
            )
        last = max((self._last.get(source, moment) for source in sources), default=moment)
        if moment < last:
            raise Refusal(
                Reason.OUT_OF_ORDER,
                f"its stamp {moment * 1e-9:.9f} s is before the last one's, {last * 1e-9:.9f} s; "
                "a stamp of 0 is always accepted, and after ~/reset any stamp is",
            )
        self._last |= dict.fromkeys(sources, moment)

    def reset(self) -> None:
        """Drop the stored stamps, e.g. because time goes back to zero."""
        self._last.clear()
