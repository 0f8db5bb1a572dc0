# SPDX-License-Identifier: Apache-2.0
"""Stamps of commands: neither older than allowed nor before the last one's."""

from __future__ import annotations

from builtin_interfaces.msg import Time

from gdfe_ros.node.refusals import Reason, Refusal


class Freshness:
    """Remembers the last stamp of each input. A stamp of zero means "now" and is always taken."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def check(self, source: str, stamp: Time, *, now: int, max_age: float) -> None:
        """Check a stamp and remember it.

        Args:
            source: the input.
            stamp: of its command.
            now: time on the clock that stamps are measured on [ns].
            max_age: of a command [s]; 0: any.

        Raises:
            Refusal: the stamp is too old, or before the last one that was taken.
        """
        moment = stamp.sec * 10**9 + stamp.nanosec
        if moment == 0:
            return
        last = self._last.get(source, moment)
        if moment < last:
            raise Refusal(
                Reason.OUT_OF_ORDER,
                f"its stamp {moment * 1e-9:.9f} s is before the last one's, {last * 1e-9:.9f} s; "
                "a stamp of 0 is always taken, and ~/reset forgets the last one",
            )
        age = (now - moment) * 1e-9
        if max_age and age > max_age:
            raise Refusal(
                Reason.STALE,
                f"its stamp {moment * 1e-9:.9f} s is {age:.3f} s old; command_max_age is {max_age:g} s",
            )
        self._last[source] = moment

    def reset(self) -> None:
        """Forget all stamps, e.g. because time goes back to zero."""
        self._last.clear()
