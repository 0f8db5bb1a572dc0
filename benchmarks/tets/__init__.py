# SPDX-License-Identifier: Apache-2.0
"""Bodies of tetrahedra: sag of a clamped bar, a ball under pressure, time per element, beside other simulators."""
