# SPDX-License-Identifier: Apache-2.0
"""Cells of meshes: faces, shape functions and shape operators of hexahedra and tetrahedra."""
