# SPDX-License-Identifier: Apache-2.0
"""Errors of meshes with few cells across, compared with other codes: torsion, bending, a confined pad, a thick tube."""
