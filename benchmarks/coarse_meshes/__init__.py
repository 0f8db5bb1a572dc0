# SPDX-License-Identifier: Apache-2.0
"""What a few cells across cost: torsion, bending, a confined pad and a thick tube, beside other codes' hexahedra."""
