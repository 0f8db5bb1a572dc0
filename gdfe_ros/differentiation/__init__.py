# SPDX-License-Identifier: Apache-2.0
"""Derivatives for `Simulation`: of a scene's outputs with respect to its parameters, by name."""
