# SPDX-License-Identifier: Apache-2.0
"""What touches what."""

from __future__ import annotations

from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.own_contact import OwnContact
from gdfe_ros.solver.contact.surface import Corners, Surface


def contacts_of(body: Body) -> list[ContactTerm]:
    """Return the contacts of a body with its obstacles, of rigid bodies with these, and of the body with itself."""
    touched = [handle for handle in body.handles if isinstance(handle, Obstacle)]
    surface, found = Surface.of(body) if touched else None, []
    for thing in touched:
        found.append(Contact(thing.name, thing, body, surface, thing.friction))
    for rigid in (thing for thing in touched if isinstance(thing, RigidBody)):
        for thing in (other for other in touched if not isinstance(other, RigidBody)):
            friction = max(rigid.friction, thing.friction)
            found.append(Contact(f"{rigid.name} on {thing.name}", thing, body, Corners.of(rigid), friction))
    if body.self_contact is not None:
        found.append(OwnContact(body.self_contact, body))
    return found
