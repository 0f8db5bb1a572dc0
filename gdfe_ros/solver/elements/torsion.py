# SPDX-License-Identifier: Apache-2.0
"""How the shear strains of a twisted element are coupled: by itself, or as a part of a section of several."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

OWN_SHEAR = (6.0 * 0.14057702, 0.37384848, 0.22901768, 0.15517115)
"""Share 1 - chi of a twisted element's own shear that counts, by the cells across a square bar: with 1, 2, 3 and 4 the
bar has Saint-Venant's constant 0.14057702 h^4 to the last digit. From 4 on it stays, which leaves at most 0.2 %: a
smaller one would leave too little against hourglassing."""


def couplings(across: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the coupling chi (m,) of elements in sections of so many cells (m,) across."""
    return (1.0 - np.array(OWN_SHEAR))[np.minimum(across, len(OWN_SHEAR)) - 1]
