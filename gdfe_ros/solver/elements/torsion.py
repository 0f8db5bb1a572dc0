# SPDX-License-Identifier: Apache-2.0
"""Coupling of the shear strains of a twisted element; it depends on the number of cells in the section."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

OWN_SHEAR = (6.0 * 0.14057702, 0.37384848, 0.22901768, 0.15517115)
"""Weight 1 - chi of the uncoupled shear strains in a twisted element, by the number of cells across a square bar. With
1, 2, 3 and 4 cells the bar has Saint-Venant's constant 0.14057702 h^4 to the last digit, where h is its width. For more
than 4 cells the weight of 4 cells is used. The error is then at most 0.2 %. Smaller weights would resist hourglassing
too little.
"""


def couplings(across: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the coupling chi (m,) of elements in sections that are ``across`` (m,) cells wide."""
    return (1.0 - np.array(OWN_SHEAR))[np.minimum(across, len(OWN_SHEAR)) - 1]
