# SPDX-License-Identifier: Apache-2.0
"""What a viewer may ask of a step, checked where it is asked: a step that is being made cannot be refused any more."""

from __future__ import annotations

import math

from gdfe_ros.node.orders import ActuatorOrder, Order, PoseOrder, PutOrder, require_near
from gdfe_ros.node.refusals import Reason, Refusal


def require_order(name: str, order: Order, size: float) -> None:
    """Check that an order of ``name`` can be carried out by a body of this size [m].

    Raises:
        Refusal: a number of it is not finite, or it leads too far away.
    """
    match order:
        case PoseOrder() | PutOrder():
            _require_finite(name, (*order.translation, *order.quaternion))
            require_near(order.translation, size)
        case ActuatorOrder():
            for each, value in order.values.items():
                _require_finite(each, (value,))


def _require_finite(name: str, numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        given = ", ".join(f"{number:g}" for number in numbers)
        raise Refusal(Reason.NOT_FINITE, f"{name} is commanded to {given}; allowed: finite numbers")
