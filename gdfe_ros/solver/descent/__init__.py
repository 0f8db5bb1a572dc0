# SPDX-License-Identifier: Apache-2.0
"""Minimisation of the potential: L-BFGS with the constant matrix, its workspace, history and stopping criteria."""
