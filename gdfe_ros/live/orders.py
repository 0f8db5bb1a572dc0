# SPDX-License-Identifier: Apache-2.0
"""Checks of viewers' orders on arrival, because a step in progress can no longer refuse an order."""

from __future__ import annotations

import math

from gdfe_ros.node.orders import ActuatorOrder, Order, PoseOrder, TeleportOrder, require_near
from gdfe_ros.node.refusals import Reason, Refusal


def require_order(name: str, order: Order, size: float) -> None:
    """Check that an order of ``name`` can be carried out by a body of this size [m].

    Raises:
        Refusal: a number is not finite, or a target is too far from rest.
    """
    match order:
        case PoseOrder() | TeleportOrder():
            _require_finite(name, (*order.translation, *order.quaternion))
            require_near(order.translation, size)
        case ActuatorOrder():
            for each, value in order.values.items():
                _require_finite(each, (value,))


def _require_finite(name: str, numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        given = ", ".join(f"{number:g}" for number in numbers)
        raise Refusal(Reason.NOT_FINITE, f"{name} is commanded to {given}; allowed: finite numbers")
