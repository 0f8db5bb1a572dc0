# SPDX-License-Identifier: Apache-2.0
"""Dynamics: inertia and viscosity as terms of the potential, and time steps."""
