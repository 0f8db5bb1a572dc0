# SPDX-License-Identifier: Apache-2.0
"""The protocol of a public benchmark of elasticity solvers, for this solver, a projected Newton method and FElupe."""
