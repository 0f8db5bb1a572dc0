# SPDX-License-Identifier: Apache-2.0
"""Selection of the contact terms of a body."""

from __future__ import annotations

from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import rigid_pairs
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.contact import Contact
from gdfe_ros.solver.contact.contact_term import ContactTerm
from gdfe_ros.solver.contact.own_contact import OwnContact
from gdfe_ros.solver.contact.rigid_contact import RigidContact, RoundContact
from gdfe_ros.solver.contact.surface import ContactSurface


def contacts_of(body: Body) -> list[ContactTerm]:
    """Return all contact terms: of the soft body with obstacles, rigid bodies and itself, and of each rigid body."""
    touched = [handle for handle in body.handles if isinstance(handle, Obstacle)]
    surface, found = ContactSurface.of(body) if touched else None, []
    for thing in touched:
        found.append(Contact(thing.name, thing, body, surface, friction=thing.friction, restitution=thing.restitution))
    for rigid, thing in rigid_pairs(touched):
        kind = RoundContact if rigid.form.rounding > 0.0 else RigidContact
        found.append(kind(rigid, thing, body))
    if body.self_contact is not None:
        found.append(OwnContact(body.self_contact, body))
    return found
