# SPDX-License-Identifier: Apache-2.0
"""Triangle surfaces: shells, their edges, searches among triangles, and solids."""
