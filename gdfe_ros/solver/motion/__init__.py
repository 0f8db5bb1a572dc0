# SPDX-License-Identifier: Apache-2.0
"""Bodies with mass: inertia and viscosity as terms of the potential, and steps in time."""
