# SPDX-License-Identifier: Apache-2.0
"""Queue of commands between the receiving and the stepping thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Collection

from gdfe_ros.node.orders import ActuatorOrder, Order, TeleportOrder
from gdfe_ros.node.refusals import Reason, Refusal

_LIMIT = 10_000


class Inbox:
    """Commands that wait for their step.

    In lockstep no command is dropped. The commands of each input are queued in the order received. With a command set,
    a step consumes one command of each input. Without a command set, it consumes the oldest command only. Under the
    other clocks only the latest command for each handle and each actuator is kept, whatever its sender and topic.

    Args:
        changed: condition that is notified when a command arrives; its lock guards the inbox.
        queued: whether the clock is lockstep.
        command_set: names of inputs; a step begins once each has a command. If it is empty, one command is enough.
    """

    def __init__(self, changed: threading.Condition, *, queued: bool, command_set: Collection[str] = ()) -> None:
        self._changed = changed
        self._queued = queued
        self._set = frozenset(command_set)
        self._waiting: dict[str, deque[tuple[int, Order]]] = {}
        self._latest: list[Order] = []
        self._count = self._number = 0

    def put(self, name: str, order: Order) -> None:
        """Add an order of the input ``name``.

        Raises:
            Refusal: in lockstep, ten thousand commands are waiting already.
        """
        with self._changed:
            if self._queued:
                self._append(name, order)
            else:
                left = [old.without(order) for old in self._latest]
                self._latest = [old for old in left if old is not None]
                if order != ActuatorOrder({}):
                    self._latest.append(order)
            self._changed.notify_all()

    def _append(self, name: str, order: Order) -> None:
        if self._count >= _LIMIT:
            raise Refusal(Reason.QUEUE_FULL, f"{_LIMIT} commands wait for their step; send slower")
        self._waiting.setdefault(name, deque()).append((self._number, order))
        self._number += 1
        self._count += 1

    def ready(self) -> bool:
        """Return whether the next step has its commands: in lockstep the command set, else any. Needs the lock."""
        if self._queued and self._set:
            return not self.missing()
        return self._count > 0 or bool(self._latest)

    def missing(self) -> list[str]:
        """Return the inputs of the command set that have no command yet, sorted. Needs the lock."""
        return sorted(name for name in self._set if not self._waiting.get(name))

    def take(self) -> list[Order]:
        """Remove and return the orders that the next step consumes, in the order received. Needs the lock."""
        if not self._queued:
            latest, self._latest = self._latest, []
            return latest
        queues = sorted((queue for queue in self._waiting.values() if queue), key=lambda queue: queue[0][0])
        if not self._set:
            queues = queues[:1]
        self._count -= len(queues)
        return [queue.popleft()[1] for queue in queues]

    def take_over(self, other: Inbox, bodies: Collection[str]) -> None:
        """Continue with the waiting commands of another inbox, except teleports of bodies not in ``bodies``."""
        self._count, self._number = 0, other._number
        self._latest = [order for order in other._latest if not _is_lost(order, bodies)]
        for name, queue in other._waiting.items():
            self._waiting[name] = deque(entry for entry in queue if not _is_lost(entry[1], bodies))
            self._count += len(self._waiting[name])

    def clear(self) -> None:
        """Drop all waiting commands, e.g. at a reset."""
        with self._changed:
            self._waiting.clear()
            self._latest.clear()
            self._count = 0


def _is_lost(order: Order, bodies: Collection[str]) -> bool:
    return isinstance(order, TeleportOrder) and order.body not in bodies
