# SPDX-License-Identifier: Apache-2.0
"""A motion carried over to a body of the same shape whose materials are others."""

from __future__ import annotations

from dataclasses import replace

from gdfe_ros.solver.state import Snapshot
from gdfe_ros.solver.value import changed


def carried(moving: Snapshot, fresh: Snapshot) -> Snapshot:
    """Return a motion as it goes on with other materials: positions, velocities and commands stay.

    What elements and descents remember belongs to the old materials and is taken from ``fresh``. Nothing counts as at
    rest, for the forces have changed; the energy that the change itself gives or takes is in no account.

    Args:
        moving: of the old body.
        fresh: of the new one, at rest.
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
