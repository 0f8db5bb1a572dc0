# SPDX-License-Identifier: Apache-2.0
"""A client of a node's services of simulation_interfaces, whose messages are built where they are not installed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import reduce
from typing import Any

from geometry_msgs.msg import Point

OK = 1
"""Code of an answer: the request succeeded."""


def fill(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message, and return it; ``__`` in a name stands for a dot."""
    for name, value in fields.items():
        *path, last = name.split("__")
        setattr(reduce(getattr, path, message), last, value)
    return message


def point(at: Sequence[float]) -> Point:
    """Return a point at x, y, z [m]."""
    return Point(**dict(zip("xyz", map(float, at), strict=True)))


def body(name: str, text: str, at: Sequence[float]) -> dict[str, Any]:
    """Return the fields that ask for a body of a description, at a place [m]."""
    return {"name": name, "entity_resource__resource_string": text, "initial_pose__pose__position": point(at)}


class Services:
    """Calls services by their kinds, such as ``SpawnEntity`` for ``~/spawn_entity``."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import action, msg, srv

        self.client, self.action, self.msg, self.srv = client, action, msg, srv

    def request(self, kind: str, **fields: Any) -> Any:
        """Return a request with these fields; ``__`` in a name stands for a dot."""
        return fill(getattr(self.srv, kind).Request(), fields)

    def ask(self, kind: str, **fields: Any) -> Any:
        """Call a service; return its answer."""
        name = re.sub("(?<!^)(?=[A-Z])", "_", kind).lower()
        return self.client.call(getattr(self.srv, kind), name, self.request(kind, **fields))

    def spawn(self, name: str, text: str, at: Sequence[float], **fields: Any) -> Any:
        """Ask for a body; return the answer."""
        return self.ask("SpawnEntity", **body(name, text, at), **fields)

    def delete(self, name: str) -> Any:
        """Delete a body; return the result."""
        return self.ask("DeleteEntity", entity=name).result

    def names(self, **fields: Any) -> list[str]:
        """Return the names of the entities that a request finds."""
        return list(self.ask("GetEntities", **fields).entities)

    def state(self, name: str) -> Any:
        """Return the state of an entity."""
        response = self.ask("GetEntityState", entity=name)
        assert response.result.result == OK, response.result.error_message
        return response.state

    def reset(self, scope: int) -> Any:
        """Reset what the scope names; return the result."""
        return self.ask("ResetSimulation", scope=scope).result
