# SPDX-License-Identifier: Apache-2.0
"""Compiled hexahedral elements: energy, forces, strains and volumes at given positions."""
