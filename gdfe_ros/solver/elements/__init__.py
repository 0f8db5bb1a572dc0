# SPDX-License-Identifier: Apache-2.0
"""Compiled elements, hexahedra and tetrahedra: energy, forces, strains and volumes at given positions."""
