# SPDX-License-Identifier: Apache-2.0
"""A client of a node's services of simulation_interfaces, whose messages are built where they are not installed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import Point

OK = 1


class Standard:
    """A client of the services."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import action, msg, srv

        self.client, self.action, self.msg, self.srv = client, action, msg, srv

    def ask(self, kind: str, **fields: Any) -> Any:
        """Call a service by its kind, as ~/spawn_entity by ``SpawnEntity``; ``__`` in a field's name is a dot."""
        name = re.sub("(?<!^)(?=[A-Z])", "_", kind).lower()
        return self.client.call(getattr(self.srv, kind), name, _filled(getattr(self.srv, kind).Request(), fields))

    def result(self, kind: str, **fields: Any) -> tuple[int, str]:
        """Call a service; return the code and the reason."""
        result = self.ask(kind, **fields).result
        return result.result, result.error_message

    def wanted(self, name: str, text: str, at: Any) -> Any:
        """Return the message of a body that is to join at a place [m]."""
        return _filled(self.msg.SpawnEntity(name=name), _body(text, at))

    def spawn(self, name: str, text: str, at: Any = (0.0, 0.0, 0.0), **changes: Any) -> Any:
        """Ask for a body at a place [m]; return the answer."""
        return self.ask("SpawnEntity", name=name, **{**_body(text, at), **changes})

    def delete(self, name: str) -> int:
        """Ask for the end of a body; return the code."""
        return self.ask("DeleteEntity", entity=name).result.result

    def names(self, **filters: Any) -> list[str]:
        """Return the names of the bodies that filters choose."""
        chosen = {f"filters__{key}": value for key, value in filters.items()}
        return list(self.ask("GetEntities", **chosen).entities)

    def state(self, name: str) -> Any:
        """Return the state of a body."""
        answer = self.ask("GetEntityState", entity=name)
        assert answer.result.result == OK, answer.result.error_message
        return answer.state

    def place(self, name: str) -> np.ndarray:
        """Return the position (3,) [m] of a body."""
        place = self.state(name).pose.position
        return np.array([place.x, place.y, place.z])

    def put(self, name: str, at: Any) -> tuple[int, str]:
        """Put a body at a place [m]; return the code and the reason."""
        return self.result("SetEntityState", entity=name, set_pose=True, state__pose__position=_point(at))

    def reset(self, scope: int) -> tuple[int, str]:
        """Reset what a scope names; return the code and the reason."""
        return self.result("ResetSimulation", scope=scope)


def _point(at: Any) -> Point:
    return Point(**dict(zip("xyz", map(float, at), strict=True)))


def _body(text: str, at: Any) -> dict[str, Any]:
    return {"entity_resource__resource_string": text, "initial_pose__pose__position": _point(at)}


def _filled(message: Any, fields: Mapping[str, Any]) -> Any:
    """Return a message with fields by name, with ``__`` for a dot."""
    for key, value in fields.items():
        *path, last = key.split("__")
        holder = message
        for part in path:
            holder = getattr(holder, part)
        setattr(holder, last, value)
    return message
