# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of solves with respect to commands, poses, materials, and the initial state."""
