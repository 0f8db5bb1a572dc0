# SPDX-License-Identifier: Apache-2.0
"""Bodies of tetrahedra compared with other simulators: sag of a bar, a ball under pressure, time per element."""
