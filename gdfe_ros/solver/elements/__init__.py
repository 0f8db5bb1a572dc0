# SPDX-License-Identifier: Apache-2.0
"""The elements, compiled: energy, forces, strains, volumes of hexahedra at given positions."""
