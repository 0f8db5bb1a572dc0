# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of what a solve found: with respect to commands, poses, materials, and the state it began with."""
