# SPDX-License-Identifier: Apache-2.0
"""The whole matrix of a kept tangent, which the solver never assembles."""

from __future__ import annotations

from scipy import sparse

from gdfe_ros.solver.matrix.tangent_assembly import Tangent
from gdfe_ros.solver.minimise.level import TangentLevel


def whole_tangent(level: TangentLevel, tangent: Tangent) -> sparse.csr_matrix:
    """Return the matrix (3 r, 3 r) of a tangent in the unknowns."""
    pattern = level._assembly
    blocks = sparse.bsr_matrix((tangent.blocks, pattern.indices, pattern.indptr)).tocsr()
    follow = sparse.block_diag([sparse.identity(3 * pattern.free), sparse.csr_matrix(tangent.motion)]).tocsr()
    rows = sparse.csr_matrix(tangent.springs.reshape(-1, follow.shape[1]))
    return (follow.T @ blocks @ follow + rows.T @ rows).tocsr()
