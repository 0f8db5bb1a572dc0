# SPDX-License-Identifier: Apache-2.0
"""Transfer of a motion to a body of the same shape with other materials."""

from __future__ import annotations

from dataclasses import replace

from gdfe_ros.solver.state import Snapshot
from gdfe_ros.solver.value import changed


def carried(moving: Snapshot, fresh: Snapshot) -> Snapshot:
    """Return a snapshot that continues a motion with other materials and the same positions, velocities and commands.

    The states of elements and minimisations belong to the old materials. They are replaced by the states of ``fresh``.
    No vertex counts as at rest, because the forces have changed. The energy account ignores the change of energy.

    Args:
        moving: snapshot of the body with the old materials.
        fresh: snapshot of the undeformed body with the new materials.
    """
    old, new = moving.state, fresh.state
    state = old.with_(
        elements=new.elements,
        history=new.history,
        part_history=new.part_history,
        tangent=new.tangent,
        sleep=new.sleep,
        unfinished=None,
        summary=changed(old.summary, converged=False),
        ledger=changed(old.ledger, failure=None, bound=None),
    )
    return replace(moving, state=state, scene=fresh.scene)
